"""The content of a frame array on disk: names, sizes, cameras, lights, pictures and layers.

A file of its own: exports to sheets, xarray and zarr need it, and `array.py` needs them.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from framearray_cli.array.images import FOR_SCREENS, format_name, read_codes, read_image, read_layers, require_size
from framearray_cli.array.integrity import list_present
from framearray_cli.array.manifest import Manifest, image_path, layers_path
from framearray_cli.array.pictures import Pictures
from framearray_cli.array.places import CAMERA_AXIS
from framearray_cli.base.colour import srgb8_from_linear

from .cameras import Cameras, check_index, index_of
from .lights import Lights, lights_along
from .relighting import Lighting

# Components of a layer in their order; a layer with others, such as the days of `sun_hours`, stays in parts.
_COMPONENTS = ("RGBA", "RGB", "XYZ", "UV", "XY")
Place: TypeAlias = float | Mapping[str, float]  # along the first light axis, or by axis


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class StoredArray:
    """A frame array on disk, under the light that it was rendered with or another one.

    Attributes:
        manifest: all that is known of the array, in the terms of the program; its fields may change from version to
            version, the fields of this class do not.
        lighting: what `relight` changed.
    """

    manifest: Manifest
    lighting: Lighting
    _pictures: Pictures = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_pictures", Pictures(self.manifest, mix=self.lighting.mix))

    @property
    def name(self) -> str:
        """Name of the job."""
        return self.manifest.name

    @property
    def folder(self) -> Path:
        """Folder of the array."""
        return self.manifest.directory

    @property
    def resolution(self) -> tuple[int, int]:
        """Width and height, pixels."""
        return self.manifest.resolution

    @property
    def fps(self) -> float:
        """Frames per second of the camera path."""
        return self.manifest.fps

    @property
    def axes(self) -> Mapping[str, int]:
        """Number of light positions along each light axis, by name; one where they are summed.

        All arrays have one axis, "light", but those with groups of sources that move on their own.
        """
        axes = self.manifest.axes
        first = next(iter(axes))
        return MappingProxyType(axes | {first: 1} if self.lighting.mixture is not None else axes)

    @property
    def shape(self) -> tuple[int, ...]:
        """N_c, the number of light positions along each axis, height, width, 3."""
        width, height = self.resolution
        return (self.manifest.n_cameras, *self.axes.values(), height, width, 3)

    @property
    def groups(self) -> tuple[str, ...]:
        """Names of what `relight` can change: groups of sources, and "background"; empty where light is stored
        all together.
        """
        return self.manifest.group_names

    @property
    def is_radiance(self) -> bool:
        """True if files contain linear radiance (EXR, TIFF), and not 8-bit sRGB, clipped to [0, 1] (PNG, JPEG)."""
        return format_name(self.manifest.parts[0].images) not in FOR_SCREENS

    @property
    def is_complete(self) -> bool:
        """True if every file of the array is there; reads the folder at each call."""
        return not list_present(self.manifest).incomplete()

    @property
    def job(self) -> dict[str, Any]:
        """The job as it was rendered, with every default filled in: tables as in a job file."""
        return self.manifest.job

    @property
    def summary(self) -> dict[str, Any]:
        """Result and cost of the runs that rendered the array, as in `manifest.toml`."""
        return self.manifest.summary

    @property
    def cameras(self) -> Cameras:
        """The camera positions: poses, intrinsics, rays."""
        return Cameras.of(self.manifest)

    @property
    def lights(self) -> Lights:
        """The light positions along the first axis, before they are summed."""
        return self.lights_along(next(iter(self.manifest.axes)))

    def lights_along(self, axis: str) -> Lights:
        """Return the light positions along an axis.

        Raises:
            KeyError: the array has no such axis.
        """
        return lights_along(self.manifest, axis)

    def file(self, c: int, l: int = 0, *, group: str | None = None) -> Path:
        """Return the file of an image; in an array with groups the file of one group.

        Raises:
            IndexError: the array has no such image.
            KeyError: it has no such group.
            OutputError: it has groups, and none was named.
        """
        found = next((one for one in self.manifest.groups if one.name == group), None)
        if group is not None and found is None:
            known = ", ".join(one.name for one in self.manifest.groups)
            raise KeyError(f"no group {group!r}; the array {f'has {known}' if known else 'stores all light together'}")
        n = len(found.lights) if found else self.manifest.n_lights
        return image_path(self.manifest, self._camera(c), int(check_index(l, n, "light")), found)

    def picture(self, c: int, l: Place = 0) -> NDArray[np.float32]:
        """Return the picture of a camera position under a light position.

        Args:
            c: camera position; -1 is the last.
            l: light position; between two of them their pictures are blended. With several light axes that along the
                first, or a mapping from axes to positions; those that are not named are in the middle of their axis.

        Returns:
            (height, width, 3), linear light with Rec. 709 primaries, your own to change. Radiance where
            `is_radiance`; else 8-bit sRGB decoded, so clipped to [0, 1], with the job's `output.exposure` in it. What
            `alpha` leaves out is black.

        Raises:
            IndexError: the array has no such position.
            OutputError: the image is not there (yet), or damaged.
        """
        c, positions = self._camera(c), self._positions(l)
        whole = self._pictures.whole_file(c, positions, self.lighting.relight)
        if whole is None:
            return np.array(self._pictures.picture(c, positions, self.lighting.relight))
        image = read_image(whole)
        require_size(whole, image.shape, self.resolution)
        return image

    def srgb(self, c: int, l: Place = 0, *, exposure: float = 0.0) -> NDArray[np.uint8]:
        """Return a picture as 8-bit sRGB codes, (height, width, 3), as screens show it.

        Args:
            c, l: as in `picture`.
            exposure: stops, added before clipping.

        Raises:
            IndexError, OutputError: as `picture`.
        """
        c, positions = self._camera(c), self._positions(l)
        whole = self._pictures.whole_file(c, positions, self.lighting.relight)
        if whole is not None and not exposure and not self.is_radiance and not self.manifest.has_alpha:
            return np.array(read_codes(whole))
        return srgb8_from_linear(self.picture(c, l) * np.float32(2.0**exposure))

    def alpha(self, c: int) -> NDArray[np.float32] | None:
        """Return the share of each pixel of a camera position that the scene covers; pictures are multiplied by it.

        Returns:
            (height, width) in [0, 1], the same under every light, your own to change; None unless the job has
            `output.alpha`.

        Raises:
            IndexError: the array has no such camera position.
            OutputError: the file is not there (yet), or damaged.
        """
        alpha = self._pictures.alpha(self._camera(c))
        return None if alpha is None else alpha.copy()

    def layers(self, c: int) -> dict[str, NDArray[np.float32]]:
        """Return the layers of a camera position, by name; no light changes them; see docs/reference/manifest.md.

        Returns:
            "reflectivity", "obscurance", "indirect" and "normal" (height, width, 3); "depth" and "samples"
            (height, width); others if the job sets them.

        Raises:
            IndexError: the array has no such camera position.
            OutputError: it was rendered without layers, or the file is not there or damaged.
        """
        parts: dict[str, dict[str, NDArray[np.float32]]] = {}
        for channel, values in read_layers(layers_path(self.manifest, self._camera(c))).items():
            name, _, component = channel.rpartition(".")
            parts.setdefault(name, {})[component] = values
        found: dict[str, NDArray[np.float32]] = {}
        for name, part in parts.items():
            order = next((known for known in _COMPONENTS if name and set(known) == set(part)), None)
            if order is not None:
                found[name] = np.stack([part[component] for component in order], axis=-1)
            elif name and list(part) == ["Z"]:  # depth
                found[name] = part["Z"]
            else:
                found |= {f"{name}.{component}".lstrip("."): values for component, values in part.items()}
        return found

    def _camera(self, c: int) -> int:
        return index_of(c, self.manifest.n_cameras, CAMERA_AXIS)

    def _positions(self, place: Place) -> tuple[float, ...]:
        """Return the position along each light axis."""
        axes = self.axes
        if not isinstance(place, Mapping):
            place = {next(iter(axes)): place}
        if unknown := [axis for axis in place if axis not in axes]:
            raise KeyError(f"no light axis {unknown[0]!r}; the array has {', '.join(axes)}")
        return tuple(check_index(place[axis], n, axis) if axis in place else float(n // 2) for axis, n in axes.items())
