"""The number of native hits per pixel, where it differs from block to block of a frame."""

from dataclasses import dataclass

import numpy as np

from framearray_cli.base.arrays import Float32, Float64, Int32

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
        """The mean of each value and those of the eight blocks around, (n_frames, n); at least 0."""
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
