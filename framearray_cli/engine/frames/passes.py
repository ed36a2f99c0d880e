"""The number of native hits of each frame, and which pixels get more or fewer.

Every frame of the array rests on (2 N_r + 1) * hits hits per pixel. Frames at the ends of the path have fewer
neighbours. So we extend the path beyond its ends by its own frames in reverse order: eye -1 repeats frame 0. Eyes of
the extension find hits of their own, with samples that the frame itself does not use, for frames at most N_r away.

With 1/m hits per pixel each frame has one hit in every m-th pixel, in other pixels than its neighbours.

With an error target the number of hits differs from block to block of a frame.
"""

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from framearray_cli.base.arrays import Float32, Float64, Int32

# A frame has a hit in at least one of this many pixels.
SPARSEST = 8


def repeated(eye: int, n_c: int) -> int:
    """The frame that an eye of the extended path repeats; of the path itself the same."""
    turned = eye % (2 * n_c)
    return min(turned, 2 * n_c - 1 - turned)


def repetitions(c: int, n_c: int, n_r: int) -> list[int]:
    """The eyes of the extended path that repeat frame c, the nearest first; c itself is the first one."""
    return sorted((eye for eye in range(-n_r, n_c + n_r) if repeated(eye, n_c) == c), key=lambda eye: abs(eye - c))


def frames_per_turn(hits: float) -> int:
    """The number of frames after which every pixel has had its hits: m for 1/m hits, 1 for whole numbers."""
    return Fraction(hits - int(hits)).limit_denominator(SPARSEST).denominator


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pass:
    """Native hits of a frame: `per_pixel` in each of `pixels`.

    Attributes:
        pixels: in the order of tracing.
        first_sample: sample number of the first hit of each pixel.
        first_hit: number of the pass's first hit in the frame.
    """

    pixels: Int32
    per_pixel: int
    first_sample: int
    first_hit: int

    @property
    def n(self) -> int:
        """Number of hits."""
        return len(self.pixels) * self.per_pixel


def passes(order: Int32, width: int, c: int, per_pixel: float, sample: int = 0) -> tuple[Pass, ...]:
    """Native hits of eye c: the whole number in every pixel, then one more in a share of the pixels.

    Args:
        order: (n_pixels,) every pixel once, in the order of tracing.
        per_pixel: hits per pixel, a multiple of 1/m with m at most `SPARSEST`.
        sample: number of the first sample.
    """
    whole = int(per_pixel)
    share = Fraction(per_pixel - whole).limit_denominator(SPARSEST)
    found = [Pass(pixels=order, per_pixel=whole, first_sample=sample, first_hit=0)] if whole else []
    if share:
        m = share.denominator
        # a step of about m / golden ratio per row spreads the pixels of a frame; a step of 1 per frame visits them all
        row_step = max(1, round(m * 0.382))
        turn = (order % width + row_step * (order // width) + c) % m
        some = np.ascontiguousarray(order[turn < share.numerator])
        found.append(Pass(pixels=some, per_pixel=1, first_sample=sample + whole, first_hit=whole * len(order)))
    return tuple(found)


def passes_of_counts(order: Int32, counts: Int32) -> tuple[Pass, ...]:
    """Native hits of a frame whose pixels have different numbers of them: one pass per number.

    Args:
        order: (n_pixels,) every pixel once, in the order of tracing.
        counts: (n_pixels,) number of hits of each pixel.
    """
    in_order, found, first_hit = counts[order], [], 0
    for count in np.unique(counts[counts > 0]).tolist():
        pixels = np.ascontiguousarray(order[in_order == count])
        found.append(Pass(pixels=pixels, per_pixel=count, first_sample=0, first_hit=first_hit))
        first_hit += found[-1].n
    return tuple(found)


def half_sizes(first: int, n: int) -> Int32:
    """The number of samples among first to first + n - 1 that are even, and that are odd, (2,)."""
    even = (first + n + 1) // 2 - (first + 1) // 2
    return np.array([even, n - even], np.int32)


# Edge of a block in pixels, and the most blocks per frame: larger frames have larger blocks.
EDGE, MOST_BLOCKS = 8, 4096


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Blocks:
    """The blocks of a frame of width x height pixels: `edge` x `edge` pixels each, fewer at the right and lower border.

    Attributes:
        of_pixel: (n_pixels,) the block of each pixel.
        shape: number of rows and columns of blocks.
    """

    width: int
    height: int
    edge: int
    of_pixel: Int32
    shape: tuple[int, int]

    @property
    def n(self) -> int:
        """Number of blocks."""
        return self.shape[0] * self.shape[1]

    def random_pixels(self, random: Float64) -> Int32:
        """A random pixel of each block, (n,).

        Args:
            random: (n, 2) numbers in [0, 1).
        """
        row, column = np.divmod(np.arange(self.n), self.shape[1])
        y = self._within(row * self.edge, self.height, random[:, 0])
        x = self._within(column * self.edge, self.width, random[:, 1])
        pixels: Int32 = (y * self.width + x).astype(np.int32)
        return pixels

    def smooth(self, values: Float64) -> Float64:
        """The mean of each value and its eight neighbours, (n_frames, n); at least 0."""
        from scipy.ndimage import uniform_filter

        smoothed = uniform_filter(values.reshape(-1, *self.shape), size=(1, 3, 3), mode="nearest")
        found: Float64 = np.maximum(smoothed.reshape(values.shape), 0.0)  # running sums may end just below 0
        return found

    def _within(self, start: Int32, end: int, random: Float64) -> Int32:
        found: Int32 = start + (random * np.minimum(self.edge, end - start)).astype(np.int32)
        return found


def blocks_of(width: int, height: int, edge: int = EDGE) -> Blocks:
    """Cut a frame into blocks; `edge` grows where there would be more than MOST_BLOCKS."""
    edge = max(edge, int(np.ceil(np.sqrt(width * height / MOST_BLOCKS))))
    rows, columns = -(-height // edge), -(-width // edge)
    of_pixel = np.arange(height)[:, None] // edge * columns + np.arange(width) // edge
    return Blocks(
        width=width, height=height, edge=edge, of_pixel=of_pixel.reshape(-1).astype(np.int32), shape=(rows, columns)
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Allotment:
    """The number of native hits per pixel, for every block of every frame.

    Attributes:
        hits: (n_frames, n_blocks) expected number n_c per pixel; each pixel gets the whole number below or above it.
    """

    blocks: Blocks
    hits: Float32

    def counts(self, c: int) -> Int32:
        """The number of native hits of each pixel of eye c, (n_pixels,).

        A pattern decides which pixels get the number above. It is even in the plane and shifts from eye to eye, so that
        over a few eyes all pixels of a block get about the same number.
        """
        y, x = np.divmod(np.arange(len(self.blocks.of_pixel)), self.blocks.width)
        # multiples of (1/g, 1/g^2), g = 1.3247..., and of the golden ratio spread evenly over [0, 1)
        shift = (0.7548776662466927 * x + 0.5698402909980532 * y + 0.6180339887498949 * c) % 1.0
        counts: Int32 = np.floor(self.hits[c][self.blocks.of_pixel] + shift).astype(np.int32)
        return counts

    def mean(self) -> Float64:
        """Expected number of native hits per pixel of each frame, (n_frames,)."""
        pixels = np.bincount(self.blocks.of_pixel, minlength=self.blocks.n)
        means: Float64 = self.hits.astype(np.float64) @ pixels / pixels.sum()
        return means
