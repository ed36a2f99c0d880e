"""Light sources at every light position: place, strength and shape, with the panels of rectangles and discs."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.base.colour import LUMINANCE

from .curves import PARALLEL, unit
from .panorama import Environment
from .profiles import Profile

SHAPES = ("rect", "disc")  # of panels, in the manifest and, by their order, in kernels


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Panel:
    """A rectangle or disc at n light positions.

    Attributes:
        shape: one of SHAPES.
        axis: (n, 3) unit normal of its front.
        across: (n, 3) unit direction in which the width of a rectangle runs.
        sides: (n, 2) width and height, scene units; of a disc the diameter, twice.
        two_sided: True if the back shines as the front does.
    """

    shape: str
    axis: Float64
    across: Float64
    sides: Float64
    two_sided: bool

    @property
    def half_axes(self) -> tuple[Float64, Float64]:
        """Vectors from the middle along the width and along the height to the edge, (n, 3) each."""
        up = np.cross(self.axis, self.across)
        return self.across * self.sides[:, :1] / 2, up * self.sides[:, 1:] / 2

    @property
    def area(self) -> Float64:
        """(n,) area of one side."""
        return np.asarray(self.sides.prod(axis=1) * (np.pi / 4 if self.shape == "disc" else 1.0))

    @property
    def flux(self) -> float:
        """Power of all light over the intensity along the normal, sr."""
        return np.pi * (1 + self.two_sided)

    def table(self, l: int) -> dict[str, Any]:
        """Describe the panel at position l as the manifest does."""
        width, height = self.sides[l].tolist()
        disc = self.shape == "disc"
        size = {"radius": width / 2} if disc else {"width": width, "height": height}
        turn = {"direction": self.axis[l].tolist()} | ({} if disc else {"across": self.across[l].tolist()})
        return {"type": self.shape} | turn | size | {"two_sided": self.two_sided}


def carry_across(axis: Float64, up_dir: Float64) -> Float64:
    """Carry the width of a panel along the path of its axis without turning it (parallel transport), (n, 3).

    So its points move smoothly from one light position to the next. At first it is level, or any direction if the panel
    faces up or down.
    """
    across = np.empty_like(axis)
    level = np.cross(up_dir, axis[0])
    if np.linalg.norm(level) <= PARALLEL:
        level = np.cross(axis[0], np.cross(np.eye(3)[np.abs(up_dir).argmin()], axis[0]))
    across[0] = unit(level)
    for l in range(1, len(axis)):
        side, before, now = across[l - 1], axis[l - 1], axis[l]
        about, cosine = np.cross(before, now), float(before @ now)
        if 1 + cosine >= PARALLEL:  # else it is turned round, and the same direction lies across
            side = side + np.cross(about, side) + np.cross(about, np.cross(about, side)) / (1 + cosine)
            side = unit(side - (side @ now) * now)  # rounding must not add up along a path
        across[l] = side
    return across


@dataclass(frozen=True, slots=True, kw_only=True)
class Emitter:
    """The surfaces of a material that shine.

    Attributes:
        flat: True if the source has the same radiance everywhere, instead of the emission of the scene file.
        absolute: True if the intensity of the source is radiance; else it multiplies the emission of the scene file.
    """

    material: str
    two_sided: bool
    flat: bool
    absolute: bool


# What the manifest calls the vector, the strength and the size of a source, by its kind.
_MANIFEST_KEYS = {"point": ("position", "intensity", "radius"), "directional": ("direction", "irradiance", "angle")}
# Arrays with a row per light position, of the parts of a source.
_ROWS = {
    "cone": ("axis", "angles_deg"),
    "panel": ("axis", "across", "sides"),
    "profile": ("axis", "zero"),
    "environment": ("rotation_deg", "factor", "maps", "level"),
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cone:
    """Cone of a spot, at n light positions.

    Attributes:
        axis: (n, 3) unit direction of the middle of its light.
        angles_deg: (n, 2) from the axis: within the first it has its full intensity, beyond the second none.
    """

    axis: Float64
    angles_deg: Float64


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LightPath:
    """One source at every light position l; in `Lights`, at every image plane.

    Attributes:
        kind: "point", "directional" or "mesh".
        vector: (n, 3) position in scene units, or unit direction in which the light travels; zeros of a mesh.
        intensity: (n, 3) linear RGB, times the source's colour: W/sr of a point, of a panel along its
            normal; W/m2 of a directional source; W/(m2 sr) of a mesh, see `Emitter`.
        size: (n,) radius of a point source, scene units, or the angle under which a directional one is seen, degrees;
            None of sources without size.
        cone: of a spot, which is a point with a cone.
        panel: of a rectangle or disc, which is a point with a panel around it.
        profile: of a point whose light was measured; `intensity` is then its largest.
        environment: of a map all around, which is a directional source whose `vector` is the way that the light of the
            middle of the map travels; `intensity` is then its radiance, integrated over all directions.
        emitter: of a mesh.
        part_of: the source whose suns it holds, cut from its map; None: it is a source of the job.
        notes: n tables with what else the manifest records of each position; or none.
        visible: True if eyes see its shape.
    """

    kind: Literal["point", "directional", "mesh"]
    vector: Float64
    intensity: Float64
    size: Float64 | None = None
    cone: Cone | None = None
    panel: Panel | None = None
    profile: Profile | None = None
    environment: Environment | None = None
    emitter: Emitter | None = None
    part_of: int | None = None
    notes: tuple[dict[str, Any], ...] = ()
    visible: bool = False

    @property
    def shines_one_way(self) -> bool:
        """True if it is a spot, a panel with one bright side, or a measured lamp."""
        one_side = self.panel is not None and not self.panel.two_sided
        return self.cone is not None or self.profile is not None or one_side

    def table(self, l: int) -> dict[str, Any]:
        """Describe the source at position l as the manifest does."""
        if self.environment is not None:
            return self.environment.table(l) | (self.notes[l] if self.notes else {})
        if self.emitter is not None:
            return {
                "type": "mesh",
                "material": self.emitter.material,
                "radiance": self.intensity[l].tolist(),
                "two_sided": self.emitter.two_sided,
            }
        vector, strength, size = _MANIFEST_KEYS[self.kind]
        values = {"type": self.kind, vector: self.vector[l].tolist(), strength: self.intensity[l].tolist()}
        values |= {} if self.size is None else {size: float(self.size[l])}
        if self.cone is not None:
            inner, outer = self.cone.angles_deg[l].tolist()
            values |= {"type": "spot", "direction": self.cone.axis[l].tolist(), "inner": inner, "outer": outer}
        values |= self.profile.table(l) if self.profile is not None else {}
        values |= {} if self.panel is None else self.panel.table(l)
        return values | (self.notes[l] if self.notes else {})

    def horizontal(self, up_dir: Float64) -> Float64 | None:
        """Irradiance of an unobstructed horizontal surface, (n,) luminance, W/m2; None of a source in the scene."""
        if self.environment is not None:
            return self.environment.horizontal
        steep = np.maximum(-self.vector @ up_dir, 0)
        return steep * (self.intensity @ LUMINANCE) if self.kind == "directional" else None

    def at(self, positions: Sequence[int]) -> "LightPath":
        """Return the source at some of its positions, in their order."""
        rows = list(positions)
        parts: dict[str, Any] = {name: part for name in _ROWS if (part := getattr(self, name)) is not None}
        for name, part in parts.items():
            values = {key: getattr(part, key) for key in _ROWS[name]}
            parts[name] = replace(part, **{key: value[rows] for key, value in values.items() if value is not None})
        return replace(
            self,
            vector=self.vector[rows],
            intensity=self.intensity[rows],
            size=None if self.size is None else self.size[rows],
            notes=tuple(self.notes[k] for k in rows) if self.notes else (),
            **parts,
        )
