"""One source along its light positions, as the renderer and the manifest take it."""

from dataclasses import dataclass
from typing import Any, Literal

from framearray_cli.base.arrays import Float64

# What the manifest calls the vector and the strength of a source, by its kind.
_MANIFEST_KEYS = {"point": ("position", "intensity"), "directional": ("direction", "irradiance")}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LightPath:
    """One source at every light position l; in `Lights`, at every image plane.

    Attributes:
        kind: "point" or "directional".
        vector: (n, 3) position in scene units, or unit direction in which the light travels.
        intensity: (n, 3) linear RGB, times the source's colour: W/sr of a point, W/m2 of a directional source.
        notes: n tables with what else the manifest records of each position; or none.
    """

    kind: Literal["point", "directional"]
    vector: Float64
    intensity: Float64
    notes: tuple[dict[str, Any], ...] = ()

    def table(self, l: int) -> dict[str, Any]:
        """Describe the source at position l as the manifest does."""
        vector, strength = _MANIFEST_KEYS[self.kind]
        values = {"type": self.kind, vector: self.vector[l].tolist(), strength: self.intensity[l].tolist()}
        return values | (self.notes[l] if self.notes else {})
