"""The light positions along an axis."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from framearray_cli.array.manifest import Manifest, moment_of
from framearray_cli.base.units import counted
from framearray_cli.tools.mixing import light_field

from .cameras import index_of


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Light:
    """One light position: all these sources shine together.

    Attributes:
        index: along the axis.
        sources: tables as in `manifest.toml`: "type", and "position" and "intensity" (W/sr) of points, "direction" (the
            way the light travels) and "irradiance" (W/m2) of directional sources, and more; in the coordinates of the
            scene file.
        ambient: I_A, (3,), radiance, of these sources.
        time: local, where a sun is among them.
    """

    index: int
    sources: tuple[Mapping[str, Any], ...]
    ambient: NDArray[np.float64]
    time: datetime | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Lights(Sequence[Light]):
    """The light positions along an axis; a sequence of `Light`.

    Attributes:
        axis: its name.
    """

    axis: str
    _all: tuple[Light, ...]
    _manifest: Manifest

    def __len__(self) -> int:
        return len(self._all)

    @overload
    def __getitem__(self, index: int) -> Light: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Light, ...]: ...
    def __getitem__(self, index: int | slice) -> Light | tuple[Light, ...]:
        return self._all[index if isinstance(index, slice) else index_of(index, len(self), self.axis)]

    def __repr__(self) -> str:
        kinds = sorted({str(source["type"]) for light in self._all for source in light.sources})
        return f"<Lights: {counted(len(self), 'position')} along {self.axis!r}, {', '.join(kinds) or 'no source'}>"

    @property
    def ambient(self) -> NDArray[np.float64]:
        """I_A of each position, (n, 3), radiance."""
        return np.array([light.ambient for light in self._all]).reshape(-1, 3)

    @property
    def times(self) -> tuple[datetime, ...] | None:
        """Local time of each position; None if no sun moves."""
        found = tuple(light.time for light in self._all if light.time is not None)
        return found if len(found) == len(self) else None

    @property
    def to_light(self) -> NDArray[np.float64]:
        """Unit direction from the scene to the light, (n, 3), of the one source that moves along this axis.

        Raises:
            OutputError: several move, or none, or points that lie on no sphere around the scene.
        """
        return light_field(self._manifest, self.axis, "to_light").to_light


def lights_along(manifest: Manifest, axis: str) -> Lights:
    """Return the light positions along an axis: with groups, the sources of all groups that move along it.

    Raises:
        KeyError: the array has no such axis.
    """
    if axis not in manifest.axes:
        raise KeyError(f"no light axis {axis!r}; the array has {', '.join(manifest.axes)}")
    parts = [part.lights for part in manifest.parts if part.axis == axis]
    lights = []
    for l, at in enumerate(zip(*parts, strict=True)):
        sources = tuple(source for light in at for source in light.sources)
        ambient = np.array([light.ambient for light in at], np.float64).sum(axis=0)
        lights.append(Light(index=l, sources=sources, ambient=ambient, time=moment_of(sources)))
    return Lights(axis=axis, _all=tuple(lights), _manifest=manifest)
