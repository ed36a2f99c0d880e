"""Expected error and time of an image with some settings of reuse, from a probe of the camera path.

Both are computed only from counts, never from a clock or free memory: the same job gives the same numbers on any
machine. `docs/decisions/settings.md` says where the constants come from, and how far off they are.
"""

from dataclasses import dataclass

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.engine.frames.passes import frame_hits

from .probe import Acceptance

# The variance of a pixel falls with this power of the hits of one eye in it, because they are evenly spread.
EVENNESS = 1.3

# Nanoseconds of processor time. Per ray of each kind, with all work that belongs to it.
EYE_RAY, OBSCURANCE_RAY, SHADOW_RAY, VISIBILITY_RAY = 115.0, 190.0, 48.0, 40.0
# Per hit: weighing it by the density of one eye in one frame, and sorting it into one frame.
WEIGH, SORT = 0.5, 5.0
# Per pixel: looking up the hits of one eye; per light position, adding a hit and storing the sum.
LOOK_UP, ADD, STORE = 18.0, 0.3, 3.2
# Per hit in a pixel: weighing it by area.
AREA = 40.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Reuse:
    """Settings of reuse: N_r, and native hits per pixel and frame."""

    n_r: int
    hits: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Model:
    """What error and time depend on besides `Reuse`; see `Acceptance`, and the job file for the other fields."""

    found: Acceptance
    n_lights: int
    obscurance: int
    balance: bool = True
    area: bool = False

    def counts(self, reuse: Reuse) -> Float64:
        """Return the expected hits, native and outer, in the pixel of each probed hit, (n,)."""
        return self._arriving(self._native(reuse), reuse.n_r)

    def least(self, reuse: Reuse) -> float:
        """Return the number of hits that 99 % of the pixels are expected to exceed."""
        return float(np.percentile(self.counts(reuse), 1))

    def variance(self, reuse: Reuse) -> float:
        """Return the expected variance of a pixel, mean over pixels, in units of that of one hit.

        It is 1 over the number of hits, where `independent_hits` counts those of one eye; a pixel that no hit reaches
        gets one.
        """
        sums = self._arriving(independent_hits(self._native(reuse)), reuse.n_r)
        return float((1.0 / np.maximum(sums, 1.0)).mean())

    def time(self, reuse: Reuse, blocks: int = 1) -> float:
        """Return the expected processor time per pixel and frame for all light positions, ns; mirrors left out.

        Args:
            blocks: number of blocks of light positions; each finds the hits again.
        """
        found, n_r = self.found, min(reuse.n_r, self.found.n_frames - 1)
        native = reuse.hits * (found.n_frames + 2 * reuse.n_r) / found.n_frames
        eyes = range(1, min((2 if self.balance else 1) * n_r, found.n_frames - 1) + 1)
        place = SORT * (2 * n_r + 1) + sum(2 * VISIBILITY_RAY * found.seen(k) for k in eyes)
        if self.balance and n_r:
            place += WEIGH * (2 * n_r + 1) ** 2
        find = EYE_RAY + OBSCURANCE_RAY * self.obscurance * found.reflecting + place
        light = SHADOW_RAY * found.shadow_rays
        used = native * (1 + 2 * sum(found.seen(k) for k in range(1, n_r + 1)))
        pixel = LOOK_UP * (2 * n_r + 1) * blocks + (ADD * used + STORE) * self.n_lights
        if self.area:
            pixel += AREA * used * blocks
        return native * (blocks * find + light) + pixel

    def _native(self, reuse: Reuse) -> Float64:
        """Return native hits per pixel of every frame, (n_frames,)."""
        return frame_hits(self.found.n_frames, reuse.n_r, reuse.hits)

    def _arriving(self, each: Float64, n_r: int) -> Float64:
        """Sum over the eyes of the window, at each probed hit, `each[eye]` per pixel times relative density, (n,)."""
        found, offsets = self.found, np.arange(-n_r, n_r + 1)
        eyes = np.clip(found.frame[:, None] + offsets, 0, found.n_frames - 1)  # beyond the path densities are 0
        sums: Float64 = (each[eyes] * found.density[:, offsets + found.reach]).sum(axis=1)
        return sums


def independent_hits(hits: Float64) -> Float64:
    """Return the number of independent hits with the same variance as the hits of one eye; see `EVENNESS`."""
    value: Float64 = np.where(hits >= 1.0, hits**EVENNESS, hits)
    return value
