"""Which file each light index goes to: images of an array, or with groups of sources, what pictures are made of."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

from .filepatterns import camera_pattern, file_patterns
from .job import Job
from .manifest import BACKGROUND
from .paths import Lights

AMBIENT = "ambient"  # R W, stored at the light index behind those of all groups; the background follows


class StoredImage(NamedTuple):
    """Where the images of one light index go.

    Attributes:
        pattern: for `str.format` with {camera} and {light}.
        light: position along the axis that {light} counts; None where nothing shines.
        group: "" in an array without groups.
    """

    pattern: str
    light: int | None
    group: str

    def file(self, c: int) -> str:
        """Name of the image of camera c."""
        return self.pattern.format(camera=c, light=self.light or 0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Files:
    """The files of an array.

    Attributes:
        images: (n_lights,) of each light index.
        layers: pattern.
    """

    images: tuple[StoredImage, ...]
    layers: str

    def pattern(self, group: str) -> str:
        """Pattern of a group, of AMBIENT or BACKGROUND, or of all images: ""; empty if there is no such thing."""
        return next((image.pattern for image in self.images if image.group == group), "")


def plain_names(name: str, n_cameras: int, n_lights: int, extension: str) -> Files:
    """Name the files of an array without groups."""
    images, layers = file_patterns(name, n_cameras, n_lights, extension)
    return Files(images=tuple(StoredImage(images, l, "") for l in range(n_lights)), layers=layers)


def array_names(job: Job, n_cameras: int, lights: Lights) -> Files:
    """Name the files of a job."""
    name, extension = job.name, job.output.format
    if not lights.groups:
        return plain_names(name, n_cameras, lights.n, extension)

    def of_groups() -> Iterator[StoredImage]:
        for group in lights.groups:
            n = len(group.positions)
            pattern, _ = file_patterns(f"{name}.{group.name}", n_cameras, n, extension)
            yield from (StoredImage(pattern, l, group.name) for l in range(n))
        for what in (AMBIENT, BACKGROUND)[: lights.n - lights.n_lit]:
            yield StoredImage(camera_pattern(name, what, n_cameras, extension), None, what)

    return Files(images=tuple(of_groups()), layers=camera_pattern(name, "layers", n_cameras, "exr"))
