"""File names of a render: the files of each image plane, with and without groups of sources."""

from dataclasses import dataclass
from typing import NamedTuple

from framearray_cli.array.manifest import BACKGROUND, camera_pattern, file_name, file_patterns
from framearray_cli.job.job import Job
from framearray_cli.scene.paths.paths import Lights, Plane

AMBIENT = "ambient"  # next to the groups: R W
_UNLIT = {Plane.INDIRECT: AMBIENT, Plane.BACKGROUND: BACKGROUND}


class PlaneFiles(NamedTuple):
    """Files of one image plane, one per camera.

    Attributes:
        pattern: for `str.format` with {camera} and {light}.
        light: position along the axis that {light} counts; None for planes that no source lights.
        group: "" in an array without groups.
    """

    pattern: str
    light: int | None
    group: str

    def file(self, c: int) -> str:
        """Return the file name of camera c."""
        return file_name(self.pattern, c, self.light or 0)


@dataclass(frozen=True, slots=True, kw_only=True)
class ArrayNames:
    """File names of an array.

    Attributes:
        images: files of each image plane.
        layers: pattern of the layers.
    """

    images: tuple[PlaneFiles, ...]
    layers: str

    def layers_file(self, c: int) -> str:
        """Return the file name of the layers of camera c."""
        return file_name(self.layers, c)

    def pattern(self, group: str) -> str:
        """Return the pattern of a group, AMBIENT, BACKGROUND, or "" (all images); empty if there is none."""
        return next((image.pattern for image in self.images if image.group == group), "")


def names_without_groups(name: str, n_cameras: int, n_lights: int, extension: str) -> ArrayNames:
    """Return the file names of an array without groups."""
    images, layers = file_patterns(name, n_cameras, n_lights, extension)
    return ArrayNames(images=tuple(PlaneFiles(images, l, "") for l in range(n_lights)), layers=layers)


def array_names(job: Job, n_cameras: int, lights: Lights) -> ArrayNames:
    """Return the file names of a job."""
    name, extension = job.name, job.output.format
    if not lights.groups:
        return names_without_groups(name, n_cameras, lights.n, extension)
    images = []
    for group in lights.groups:
        n = len(group.positions)
        pattern, _ = file_patterns(f"{name}.{group.name}", n_cameras, n, extension)
        images += [PlaneFiles(pattern, l, group.name) for l in range(n)]
    for group_name in map(_UNLIT.__getitem__, lights.unlit):
        images.append(PlaneFiles(camera_pattern(name, group_name, n_cameras, extension), None, group_name))
    return ArrayNames(images=tuple(images), layers=camera_pattern(name, "layers", n_cameras, "exr"))
