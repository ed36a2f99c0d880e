"""The light positions that pilots look at, those of all groups together, and how messages name places."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from framearray_cli.base.arrays import Float32, Float64
from framearray_cli.engine.inputs.lights import LightArrays
from framearray_cli.scene.paths.paths import Lights, Plane

POSITIONS = 8  # along each light axis, at most
DIM = 0.01  # of the brightest light position; a darker one fades in or out, and is meant to be dark


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Positions:
    """Light positions: K of all groups together, each one position along every axis.

    Attributes:
        planes: the image planes looked at.
        together: K tuples of indices in `planes` that shine together.
        index: K tables of the position along each axis.
        power: (K,) strength of all sources, in units of the strongest position; 0 where all are off.
        unlit: plane at which no source shines, in an array with groups.
    """

    planes: tuple[int, ...]
    together: tuple[tuple[int, ...], ...]
    index: tuple[dict[str, int], ...]
    power: Float64
    unlit: int | None

    @property
    def bright(self) -> "np.ndarray[tuple[int], np.dtype[np.bool_]]":
        """(K,) whether sources shine, and not only faintly."""
        return self.power > DIM

    def ambient(self, intensity: Float32) -> Float64:
        """Return I_A of all groups together, (K, 3), from that of each plane."""
        each = intensity.astype(np.float64)
        if self.unlit is None:
            return each[[self.planes[planes[0]] for planes in self.together]]
        dark = each[self.unlit]
        return np.stack([dark + sum(each[self.planes[p]] - dark for p in planes) for planes in self.together])


def choose_positions(lights: Lights, arrays: LightArrays) -> Positions:
    """Choose some light positions, evenly from the first to the last along every axis at once."""
    if lights.groups:
        axes = {group.axis: len(group.positions) for group in lights.groups}
        steps = min(POSITIONS, max(axes.values()))
        index = [{axis: round((n - 1) * share) for axis, n in axes.items()} for share in np.linspace(0, 1, steps)]
        shining = [[group.positions[at[group.axis]] for group in lights.groups] for at in index]
        unlit = lights.planes.index(Plane.INDIRECT)
    else:
        index = [{"light": l} for l in evenly_from_end_to_end(lights.n, POSITIONS)]
        shining, unlit = [[at["light"]] for at in index], None
    planes = sorted({p for group in shining for p in group})
    strength = (arrays.strength.max(axis=1) * arrays.lit).sum(axis=0)  # (n_planes,)
    power = np.array([sum(float(strength[p]) * float(arrays.colour[p].max()) for p in group) for group in shining])
    return Positions(
        planes=tuple(planes),
        together=tuple(tuple(planes.index(p) for p in group) for group in shining),
        index=tuple(index),
        power=power / max(float(power.max()), np.finfo(np.float64).tiny),
        unlit=unlit,
    )


def evenly_from_end_to_end(n: int, most: int) -> list[int]:
    """Return at most `most` of the numbers 0 to n - 1, evenly spaced from the first to the last."""
    return sorted({round(float(k)) for k in np.linspace(0, n - 1, min(n, most))})


def runs_text(flagged: Sequence[bool], names: Sequence[int]) -> str:
    """Name runs of flagged places: "12-31,47"."""
    runs = []
    for bad, group in groupby(zip(flagged, names, strict=True), key=lambda pair: pair[0]):
        run = [name for _, name in group]
        if bad:
            runs.append(f"{run[0]}-{run[-1]}" if run[0] != run[-1] else str(run[0]))
    return ",".join(runs)


def lights_text(flagged: Sequence[bool], positions: Positions) -> str:
    """Name light positions of all groups together: "light 3-5", with the positions of further axes."""
    return ", ".join(
        f"{axis} {runs_text(flagged, [at[axis] for at in positions.index])}" for axis in positions.index[0]
    )
