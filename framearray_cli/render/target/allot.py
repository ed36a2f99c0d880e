"""Number of native hits of each block of a frame, so that no frame has more error than wanted.

A pilot (pilot.py) measures u(b), the variance of a pixel of block b with one hit from each frame of the window, mean
over light positions and channels. With n(b) hits from each frame, which count as m(b) independent ones, the variance is
u(b) / m(b), so the squared error of a frame's images is

    e^2 = mean over b of u(b) / m(b), m(b) = independent_hits(n(b)).

Of all n with the same e, the one with the fewest hits has n(b)^(1 + p) proportional to u(b), with p the power of
`independent_hits` [Neyman34].
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from framearray_cli.base.arrays import Float64, Int32
from framearray_cli.engine.frames.passes import Blocks

from ..automatic.cost import EVENNESS, independent_hits

# The fewest hits per pixel: below, most pixels would depend on hits of distant frames.
FEWEST = 0.25
# Bisection steps for the logarithm of a frame's factor.
HALVINGS = 60
# Logarithm of the largest final correction of all hits, and bisection steps for it.
MOST_CHANGE, CHANGES = 2.0, 12


def fewest_hits(u: Float64, wanted: float, most: float) -> Float64:
    """Return the fewest native hits per pixel with which no frame exceeds the wanted error, (n_frames, n_blocks).

    Args:
        u: (n_frames, n_blocks) variance of a pixel with one hit from each frame of the window.
        wanted: mean variance that a frame may have.
        most: limit of hits per pixel; where it binds, the wanted error may be missed.
    """
    share = u ** (1.0 / (1.0 + EVENNESS))
    largest = np.maximum(share.max(axis=1), 1e-300)
    # from the fewest hits everywhere to the most wherever there is noise
    low = np.log(FEWEST / largest)
    high = np.log(most / np.where(share > 0, share, largest[:, None]).min(axis=1))

    def with_factor(logs: Float64) -> Float64:
        hits: Float64 = np.clip(np.exp(logs)[:, None] * share, FEWEST, most)
        return hits

    for _ in range(HALVINGS):
        middle = (low + high) / 2
        enough = variances(u, with_factor(middle)) <= wanted
        low, high = np.where(enough, low, middle), np.where(enough, middle, high)
    return with_factor(high)


def variances(u: Float64, hits: Float64) -> Float64:
    """Return the mean variance of every frame, (n_frames,), for given native hits per pixel of each block."""
    means: Float64 = (u / independent_hits(hits)).mean(axis=1)
    return means


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Witnesses:
    """Pairs of hits of one frame that judge the allotment: one pair per block and half of the pilot.

    Attributes:
        c: the frame.
        first_eye: of its window.
        variance: (2, n_blocks) of one hit, by half.
        block: (2, 2, n_blocks, n_eyes) by half and hit: the block in which each eye sees the hit.
        density: of the same shape: hits of that eye per hit of eye c there; 0 where it does not see the place.
    """

    c: int
    first_eye: int
    variance: Float64
    block: Int32
    density: Float64

    def variances(self, whole: Float64, by_half: Float64) -> float:
        """Return the mean variance of the frame.

        Args:
            whole: (n_frames, n_blocks) native hits per pixel, allotted by the whole pilot.
            by_half: (2, n_frames, n_blocks) the same by each half of the pilot. For their own frame, pairs count the
                hits that the other half allotted.
        """
        found = []
        for half in range(2):
            eyes = np.arange(self.block.shape[-1])
            hits = whole[self.first_eye + eyes, self.block[half]]
            own = self.c - self.first_eye
            hits[..., own] = by_half[1 - half][self.c, self.block[half][..., own]]
            arriving = (self.density[half] * independent_hits(hits)).sum(axis=-1)
            found.append((self.variance[half] * (1.0 / arriving).mean(axis=0)).mean())
        return float(np.mean(found))


def allot(
    u: Float64, blocks: Blocks, wanted: float, most: float, witnesses: Sequence[Witnesses]
) -> tuple[Float64, Float64]:
    """Return native hits of every block of every frame, and the expected mean variance of each witness's frame.

    A block whose variance the pilot underestimates by chance gets few hits, so a pilot judges its own allotment too
    well. But every place gets its hits from all frames of a window, whose pilots err independently. So pairs of hits
    that had no part in the allotment judge it, and one factor corrects all hits until the error is as wanted.

    Args:
        u: (2, n_frames, n_blocks) by each half of the pilot, see `fewest_hits`.
    """
    whole = fewest_hits(blocks.smooth(u.mean(axis=0)), wanted, most)
    halves = np.stack([fewest_hits(blocks.smooth(half), wanted, most) for half in u])

    def scale(hits: Float64, log: float) -> Float64:
        found: Float64 = np.clip(np.exp(log) * hits, FEWEST, most)
        return found

    def judge(log: float) -> Float64:
        hits, by_half = scale(whole, log), scale(halves, log)
        return np.array([witness.variances(hits, by_half) for witness in witnesses])

    low, high = -MOST_CHANGE, MOST_CHANGE
    for _ in range(CHANGES):
        middle = (low + high) / 2
        low, high = (low, middle) if judge(middle).mean() <= wanted else (middle, high)
    return scale(whole, high), judge(high)
