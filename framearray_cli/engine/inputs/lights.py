"""Positions and strengths of all lights, in the form that kernels read.

Light reuse stores one number per hit and light position if possible. Often all sources of a light position share one
colour. Then a hit stores a scalar irradiance, and the colour is multiplied in once per pixel. Only where sources of
different colours shine together does a hit store three channels.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from framearray_cli.base.arrays import Float32, Float64, Int32, with_room
from framearray_cli.scene.paths.lightpath import SHAPES, LightPath
from framearray_cli.scene.paths.paths import Lights

from ..kernels.bundle import bundle
from .emitters import NONE as NO_EMITTERS
from .emitters import Emitters
from .maps import NO_MAPS, Maps, map_arrays
from .profiles import NONE, Profiles, profile_arrays

PANEL_ROWS = 12
SHARPEST = 0.001  # width of a spot's edge over the width of its cone, in cosines
# Codes of kinds and shapes, panels last but meshes.
KINDS = {name: code for code, name in enumerate(("point", "directional", *SHAPES, "mesh"))}
POINT, DIRECTIONAL, RECT, DISC, MESH = (KINDS[name] for name in ("point", "directional", "rect", "disc", "mesh"))


@bundle
class LightArrays(NamedTuple):
    """All sources of a job for kernels, which read packets of light positions; see `pad_lights`.

    Attributes:
        span: (2,) the first source that shines, and the end of those that do; see `of_source`.
        kind: (n_sources,) POINT, DIRECTIONAL, RECT, DISC or MESH.
        vector: (n_sources, 3, n_lights) position, centred, or the unit direction that light travels.
        strength: (n_sources, channels, n_lights) W/sr or W/m2 in units of `colour`; 1 or 3 channels. A panel's
            is that along its normal, a mesh's its radiance.
        lit: (n_sources, n_lights) 1 where a source shines, else 0.
        size: (n_sources, n_lights) the squared radius of a point source, or sin^2 of half the angle of a directional
            one; no rows where no source has a size.
        cone: (n_sources, 5, n_lights) the unit axis of a spot, and a and b of its falloff, see `spot_share`; 0, 0 and 1
            of other sources. No rows where there are no spots.
        panel: (n_sources, PANEL_ROWS, n_lights) of a rectangle or disc the half axes a and b, the unit normal, the
            share of its light that the back sends, times -1, and the lengths of a and b; 0 of other sources. No
            rows where there are none of them.
        colour: (n_lights, 3) factor of a stored irradiance; ones if there are 3 channels.
        profiles: of lamps with measured light.
        maps: of environments, which are DIRECTIONAL with a map.
        emitters: the triangles of meshes.
    """

    span: Int32
    kind: Int32
    vector: Float32
    strength: Float32
    lit: Float32
    size: Float32
    cone: Float32
    panel: Float32
    colour: Float32
    profiles: Profiles = NONE
    maps: Maps = NO_MAPS
    emitters: Emitters = NO_EMITTERS

    @property
    def channels(self) -> int:
        """1 where all sources of each light position share a colour, else 3."""
        return int(self.strength.shape[1])

    @property
    def n_lights(self) -> int:
        """Number of light positions N_l."""
        return int(self.vector.shape[2])

    def at(self, positions: Sequence[int]) -> "LightArrays":
        """Return the lights at some of their positions, in the same units."""
        some = list(positions)
        found = self._replace(
            vector=self.vector[:, :, some],
            strength=self.strength[:, :, some],
            lit=self.lit[:, some],
            size=self.size[:, some],
            cone=self.cone[:, :, some],
            panel=self.panel[:, :, some],
            colour=self.colour[some],
            profiles=self.profiles._replace(frame=self.profiles.frame[:, :, some]),
            maps=self.maps._replace(row=self.maps.row[:, some] if len(self.maps.row) else self.maps.row),
        )
        return pad_lights(found)

    def of_source(self, s: int) -> "LightArrays":
        """Return the lights of which shadow rays look at source s alone; shares memory."""
        return self._replace(span=np.array([s, s + 1], np.int32))


_NONE = np.empty(0, np.float32)
NO_LIGHTS = LightArrays(
    span=np.zeros(2, np.int32), kind=np.empty(0, np.int32),
    vector=_NONE.reshape(0, 3, 0), strength=_NONE.reshape(0, 1, 0),
    lit=_NONE.reshape(0, 0), size=_NONE.reshape(0, 0), cone=_NONE.reshape(0, 5, 0),
    panel=_NONE.reshape(0, PANEL_ROWS, 0), colour=_NONE.reshape(0, 3),
)  # fmt: skip


def pad_lights(lights: LightArrays) -> LightArrays:
    """Copy the lights, with memory behind each array: kernels read whole packets and ignore what is behind the end."""

    def copied(array: Any) -> Any:
        room = with_room(array.shape, array.dtype, fill=1)
        room[:] = array
        return room

    profiles = lights.profiles._replace(frame=copied(lights.profiles.frame))
    arrays: Any = (array if isinstance(array, tuple) else copied(array) for array in lights)
    maps = lights.maps._replace(row=copied(lights.maps.row))
    return LightArrays(*arrays)._replace(profiles=profiles, maps=maps)


def light_arrays(lights: Lights, centre: Float64, emitters: Emitters = NO_EMITTERS) -> LightArrays:
    """Make the arrays of all lights that kernels read, with one channel if that suffices.

    Args:
        emitters: of the sources that are meshes.
    """
    intensity = np.stack([source.intensity for source in lights.sources])  # (n_sources, n_lights, 3)
    vector = np.stack(
        [source.vector - centre if source.kind == "point" else source.vector for source in lights.sources]
    )
    colour = intensity.sum(axis=0)
    largest = colour.max(axis=-1, keepdims=True)
    colour = np.divide(colour, largest, out=np.ones_like(colour), where=largest > 0)
    scalar = intensity.max(axis=-1, keepdims=True)
    coloured = emitters.coloured or any(path.environment and not path.environment.is_grey for path in lights.sources)
    # beyond that, float32 would show the difference
    if not coloured and np.allclose(scalar * colour, intensity, rtol=1e-6, atol=0.0):
        strength = scalar
    else:
        strength, colour = intensity, np.ones_like(colour)
    found = LightArrays(
        span=np.array([0, len(lights.sources)], np.int32),
        kind=np.array([KINDS[s.panel.shape if s.panel else s.kind] for s in lights.sources], np.int32),
        vector=np.asarray(vector.transpose(0, 2, 1), np.float32),
        strength=np.asarray(strength.transpose(0, 2, 1), np.float32),
        lit=np.asarray((intensity > 0).any(axis=-1), np.float32),
        size=_of_sources(lights, (), _size),
        cone=_of_sources(lights, (5,), _cone, [[0.0]] * 4 + [[1.0]]),
        panel=_of_sources(lights, (PANEL_ROWS,), _panel),
        colour=np.asarray(colour, np.float32),
        profiles=profile_arrays(lights),
        maps=map_arrays(lights.sources),
        emitters=emitters,
    )
    return pad_lights(found)


def _of_sources(lights: Lights, shape: tuple[int, ...], values: Callable[[LightPath], Any], others: Any = 0) -> Float32:
    """The values of all sources, (n_sources, *shape, n_lights), `others` of those with None; no rows if all have."""
    each = [values(source) for source in lights.sources]
    found = np.empty((len(each) if any(value is not None for value in each) else 0, *shape, lights.n), np.float32)
    for rows, value in zip(found, each, strict=False):
        rows[:] = others if value is None else value
    return found


def _size(source: LightPath) -> Any:
    """`LightArrays.size` of a source."""
    if source.size is None:
        return None
    return source.size**2 if source.kind == "point" else np.sin(np.radians(source.size) / 2) ** 2


def _cone(source: LightPath) -> Any:
    """`LightArrays.cone` of a source; a and b as in glTF's KHR_lights_punctual."""
    if source.cone is None:
        return None
    inner, outer = np.cos(np.radians(source.cone.angles_deg.T))
    a = 1 / np.maximum(inner - outer, SHARPEST * (1 - outer))
    return [*source.cone.axis.T, a, -a * outer]


def _panel(source: LightPath) -> Any:
    """`LightArrays.panel` of a source."""
    if (panel := source.panel) is None:
        return None
    back = np.full(len(panel.axis), -1.0 if panel.two_sided else 0.0)
    return [*np.concatenate([*panel.half_axes, panel.axis], axis=1).T, back, *panel.sides.T / 2]
