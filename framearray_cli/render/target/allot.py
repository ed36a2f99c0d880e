"""How many native hits each block of a frame is to have, so that no frame has more error than wanted.

A pilot finds (target.py) u(b), the variance of a pixel of block b, mean over light positions and channels, were each
frame of the window to give it one hit. With n(b) hits from each frame, which count as m(b) independent ones, it is
u(b) / m(b), so the squared error of a frame's images is

    e^2 = mean over b of u(b) / m(b), m(b) = independent_hits(n(b)).

Of all n with the same e, that with the fewest hits has n(b)^(1 + p) in proportion to u(b), with p the power of
`independent_hits` [Neyman34].
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from framearray_cli.base.arrays import Float64, Int32
from framearray_cli.engine.frames.blocks import Blocks

from ..automatic.cost import EVENNESS, independent_hits

# The fewest hits a pixel of a frame: below, most pixels would rest on hits of frames far away.
FEWEST = 0.25
# Halvings of the interval in which the logarithm of a frame's factor is looked for.
HALVINGS = 60
# Logarithm of the largest factor that all hits are changed by in the end, and halvings until it is found.
MOST_CHANGE, CHANGES = 2.0, 12


def fewest_hits(u: Float64, wanted: float, most: float) -> Float64:
    """The fewest native hits a pixel with which no frame has more error than wanted, (n_frames, n_blocks).

    Args:
        u: (n_frames, n_blocks) variance of a pixel with one hit from each frame of the window.
        wanted: mean variance that a frame may have.
        most: hits a pixel, at most; where it binds, less may be reached than is wanted.
    """
    share = u ** (1.0 / (1.0 + EVENNESS))
    largest = np.maximum(share.max(axis=1), 1e-300)
    # between those that are the fewest everywhere, and the most wherever there is any noise
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
    """Mean variance of every frame, (n_frames,), with some native hits a pixel of each block."""
    means: Float64 = (u / independent_hits(hits)).mean(axis=1)
    return means


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Witnesses:
    """Pairs of hits of one frame that judge how many hits were allotted: one pair a block for each half of the pilot.

    Attributes:
        c: the frame.
        first_eye: of its window.
        variance: (2, n_blocks) of one hit, by half.
        block: (2, 2, n_blocks, n_eyes) by half and hit: the block that each eye sees the place in.
        density: of the same shape: hits of that eye for one of eye c there; 0 where it does not see the place.
    """

    c: int
    first_eye: int
    variance: Float64
    block: Int32
    density: Float64

    def variances(self, whole: Float64, ways: Float64) -> float:
        """Mean variance of the frame.

        Args:
            whole: (n_frames, n_blocks) native hits a pixel.
            ways: (2, n_frames, n_blocks) the same by each half of the pilot alone. Of their own frame, pairs are told
                what the other half would have allotted.
        """
        found = []
        for half in range(2):
            eyes = np.arange(self.block.shape[-1])
            hits = whole[self.first_eye + eyes, self.block[half]]
            own = self.c - self.first_eye
            hits[..., own] = ways[1 - half][self.c, self.block[half][..., own]]
            arriving = (self.density[half] * independent_hits(hits)).sum(axis=-1)
            found.append((self.variance[half] * (1.0 / arriving).mean(axis=0)).mean())
        return float(np.mean(found))


def allot(
    u: Float64, blocks: Blocks, wanted: float, most: float, witnesses: Sequence[Witnesses]
) -> tuple[Float64, Float64]:
    """Native hits of every block of every frame, and the mean variance that is expected of each witness's frame.

    What was found by chance to vary little gets few hits, so that a pilot judges its own allotment too well. On the
    other hand every place gets its hits from all frames of a window, whose pilots err independently. So pairs of hits
    that had no say judge what they will get from all of them, and all hits are changed by one factor until it is right.

    Args:
        u: (2, n_frames, n_blocks) by each half of the pilot, see `fewest_hits`.
    """
    whole = fewest_hits(blocks.smooth(u.mean(axis=0)), wanted, most)
    ways = np.stack([fewest_hits(blocks.smooth(half), wanted, most) for half in u])

    def changed(hits: Float64, log: float) -> Float64:
        found: Float64 = np.clip(np.exp(log) * hits, FEWEST, most)
        return found

    def judged(log: float) -> Float64:
        hits, by_half = changed(whole, log), changed(ways, log)
        return np.array([witness.variances(hits, by_half) for witness in witnesses])

    low, high = -MOST_CHANGE, MOST_CHANGE
    for _ in range(CHANGES):
        middle = (low + high) / 2
        low, high = (low, middle) if judged(middle).mean() <= wanted else (middle, high)
    return changed(whole, high), judged(high)
