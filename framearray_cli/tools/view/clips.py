"""Clips of an export: a few light positions of one camera as VP9 in WebM, a tenth of the bytes of JPEG.

A clip starts with its only key frame, and frames depend on earlier ones only, so any picture needs at most `LENGTH`
frames. Tiles have the same codes. The page reads luma and chroma, and converts them itself: matrix of Rec. 709, luma
from 16 to 235. Firefox hands out converted pictures, and ignores the flag of a full range.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from io import BytesIO

from framearray_cli.base.arrays import Bytes
from framearray_cli.base.errors import MissingExtraError

from ..movie.video import can_make, encode_pictures, require_av

LENGTH = 12  # pictures: 8 need a fifth more bytes at the same quality, 48 two thirds, but their last one comes later
DECODER = "vp09.00.40.08"  # profile, level and bits, for WebCodecs
RATE = 10  # frames per second of a clip; the page shows single frames
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
MARGIN = 0.92  # of a limit: the other pictures may be larger than the samples


@dataclass(frozen=True, slots=True, kw_only=True)
class Clips:
    """Settings of an export with clips.

    Attributes:
        crf: quality of VP9, 0 to 63, lower is better.
        factor: pixels of the array per pixel of the export, along each side.
    """

    crf: int = 32
    factor: int = 1

    @property
    def stamp(self) -> str:
        """All that the bytes of a clip depend on."""
        return repr((self, LENGTH, OPTIONS))

    def encode(self, pictures: Sequence[Bytes]) -> bytes:
        """Encode pictures of one size, (h, w, 3) codes, as a WebM file; odd sizes grow by one row or column."""
        av = require_av()
        height, width = pictures[0].shape[:2]
        file = BytesIO()
        with av.open(file, "w", format="webm", options={"fflags": "+bitexact"}) as container:  # without random numbers
            options = OPTIONS | {"crf": str(self.crf), "g": str(LENGTH)}
            stream = container.add_stream("libvpx-vp9", rate=RATE, options=options)
            stream.width, stream.height, stream.pix_fmt = width + width % 2, height + height % 2, "yuv420p"
            context = stream.codec_context
            context.time_base = Fraction(1, RATE)
            context.thread_count = 1  # cameras are encoded in parallel
            encode_pictures(container, stream, pictures, context.time_base)
        return file.getvalue()


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
