"""A light source at every light position: where it is, how strong, and what shape it has."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

from framearray_cli.base.arrays import Float64

from .panels import Panel
from .panorama import Environment
from .profiles import Profile


@dataclass(frozen=True, slots=True, kw_only=True)
class Emitter:
    """The surfaces of a material that shine.

    Attributes:
        flat: whether the source has the same radiance everywhere, in place of the emission of the scene file.
        absolute: whether the intensity of the source is radiance; else it multiplies the emission of the scene file.
    """

    material: str
    two_sided: bool
    flat: bool
    absolute: bool


# What the manifest calls the vector, the strength and the size of a source, by its kind.
_MANIFEST_KEYS = {"point": ("position", "intensity", "radius"), "directional": ("direction", "irradiance", "angle")}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cone:
    """Where a spot shines, at n light positions.

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
        visible: whether eyes see its shape.
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
        """Whether it is a spot, a panel with one bright side, or a measured lamp."""
        one_side = self.panel is not None and not self.panel.two_sided
        return self.cone is not None or self.profile is not None or one_side

    def table(self, l: int) -> dict[str, Any]:
        """Describe the source at position l as the manifest does."""
        if self.environment is not None:
            return self.environment.table(l)
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

    def at(self, positions: Sequence[int]) -> "LightPath":
        """Return the source at some of its positions, in their order."""
        rows = list(positions)
        return replace(
            self,
            vector=self.vector[rows],
            intensity=self.intensity[rows],
            size=None if self.size is None else self.size[rows],
            cone=self.cone and Cone(axis=self.cone.axis[rows], angles_deg=self.cone.angles_deg[rows]),
            panel=self.panel and self.panel.at(rows),
            profile=self.profile and self.profile.at(rows),
            environment=self.environment and self.environment.at(rows),
            notes=tuple(self.notes[k] for k in rows) if self.notes else (),
        )
