"""Clips of an export: a few light positions of one camera, or cameras of a layer, as VP9, a tenth of the bytes of JPEG.

The picture in the middle is a key frame. From there two arms go to both ends, each frame coded from the one before,
so any picture needs at most half of the frames. A file contains the number of pictures and the size of each, as 32-bit
numbers, then the packets in order of the places. Tiles have the same codes. The page reads luma and chroma,
and converts them itself: matrix of Rec. 709, luma from 16 to 235. Firefox hands out converted pictures, and ignores the
flag of a full range.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Self

import numpy as np

from framearray_cli.base.arrays import Bytes
from framearray_cli.base.errors import MissingExtraError

from ..movie.video import can_make, encoded, require_av

LENGTH = 12  # pictures: 8 need a fifth more bytes at the same quality, 24 a quarter less, but the ends come later
DECODER = "vp09.00.40.08"  # profile, level and bits, for WebCodecs
RATE = 10  # frames per second, by which encoders judge; the page shows single frames
# Speed 5 needs half the time for a sixth more bytes. Tiles are decoded in parallel; every frame is shown.
OPTIONS = {
    "b": "0",
    "deadline": "realtime",
    "cpu-used": "4",
    "tile-columns": "2",
    "lag-in-frames": "0",
    "auto-alt-ref": "0",
    "colorspace": "bt709",
    "color_range": "tv",
}
LAYER_CRF = 10  # more for layers, whose pictures change from camera to camera
MARGIN = 0.92  # of a limit: the other pictures may be larger than the samples


@dataclass(frozen=True, slots=True, kw_only=True)
class Clips:
    """Settings of an export with clips.

    Attributes:
        crf: quality of VP9, 0 to 63, lower is better.
        factor: pixels of the array per pixel of the export, along each side.
    """

    crf: int = 33
    factor: int = 1

    @property
    def stamp(self) -> str:
        """All that the bytes of a clip depend on."""
        return repr((self, LENGTH, OPTIONS))

    @property
    def of_layers(self) -> Self:
        """The settings of layers, in about half of the bytes."""
        return replace(self, crf=self.crf + LAYER_CRF)

    def encode(self, pictures: Sequence[Bytes]) -> bytes:
        """Encode pictures of one size, (h, w, 3) codes; odd sizes grow by one row or column."""
        middle = len(pictures) // 2
        key, *after = self._arm(pictures[middle:])
        before = self._arm(pictures[middle::-1])[:0:-1] if middle else []
        packets = [*before, key, *after]
        return np.array([len(packets), *map(len, packets)], "<u4").tobytes() + b"".join(packets)

    def _arm(self, pictures: Sequence[Bytes]) -> list[bytes]:
        """Encode pictures, the first as a key frame; it has the same bytes whatever follows."""
        height, width = pictures[0].shape[:2]
        time_base = Fraction(1, RATE)
        encoder = require_av().CodecContext.create("libvpx-vp9", "w")
        encoder.options = OPTIONS | {"crf": str(self.crf), "g": str(LENGTH)}
        encoder.width, encoder.height, encoder.pix_fmt = width + width % 2, height + height % 2, "yuv420p"
        encoder.time_base, encoder.framerate = time_base, 1 / time_base
        encoder.thread_count = 1  # cameras are encoded in parallel
        return [bytes(packet) for packet in encoded(encoder, pictures, time_base)]


def can_encode() -> bool:
    """Return whether PyAV is there, with its encoder of VP9."""
    try:
        return can_make(".webm")
    except MissingExtraError:
        return False


# The best first.
CHOICES = tuple(
    Clips(crf=crf, factor=factor)
    for factor, quality in ((1, (24, 28, 32, 36, 40, 44)), (2, (32, 38, 44)), (4, (44,)))
    for crf in quality
)
