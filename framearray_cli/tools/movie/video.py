"""Videos, one kind of target of `movie.py`. Only this module uses PyAV, the optional extra `movie`."""

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from types import ModuleType
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.errors import MissingExtraError, OutputError
from framearray_cli.base.extras import extra, install_command
from framearray_cli.base.files import whole_file

K_R, K_B = 0.2126, 0.0722  # shares of red and blue in luma
LUMA_BLACK, LUMA_STEPS = 64, 876  # Y' from 64 to 940
CHROMA_ZERO, CHROMA_STEPS = 512, 896  # Cb and Cr from 64 to 960
# crf: quality, lower is better. faststart: the index comes first, so that a browser plays while it loads.
_H264 = {"crf": "16", "preset": "medium"}
_FAST_START = {"movflags": "+faststart"}
_BT709 = 1  # the number in H.264, VP9 and ProRes of the primaries, curve and matrix of Rec. 709


def planes_422_10(codes: NDArray[np.uint16]) -> tuple[NDArray[np.uint16], NDArray[np.uint16], NDArray[np.uint16]]:
    """Convert a picture; chroma lies on even columns, with weights 1-2-1 of their neighbourhood.

    Args:
        codes: (h, w, 3) uint16, w even.

    Returns:
        Y' of shape (h, w), Cb and Cr of shape (h, w / 2).
    """
    r, g, b = (codes[..., i].astype(np.float32) / 65535 for i in range(3))
    y = K_R * r + (1 - K_R - K_B) * g + K_B * b
    cb, cr = (b - y) / (2 * (1 - K_B)), (r - y) / (2 * (1 - K_R))
    return (
        np.rint(LUMA_BLACK + LUMA_STEPS * y).astype(np.uint16),
        np.rint(CHROMA_ZERO + CHROMA_STEPS * _halve_width(cb)).astype(np.uint16),
        np.rint(CHROMA_ZERO + CHROMA_STEPS * _halve_width(cr)).astype(np.uint16),
    )


def _halve_width(plane: NDArray[Any]) -> NDArray[Any]:
    """Keep even columns: half of their value, and a quarter of either neighbour."""
    wide = np.pad(plane, ((0, 0), (1, 1)), mode="edge")
    result: NDArray[Any] = wide[:, :-2:2] / 4 + wide[:, 1:-1:2] / 2 + wide[:, 2::2] / 4
    return result


@dataclass(frozen=True, slots=True, kw_only=True)
class Container:
    """Settings of one kind of movie file.

    Attributes:
        format: name of the container, as the temporary file has another suffix.
        codec: the encoder.
        pixels: FFmpeg's name of the pixel format.
        stream: options of the encoder.
        file: options of the container.
    """

    format: str
    codec: str
    pixels: Literal["yuv420p", "yuv422p10le"] = "yuv420p"
    stream: dict[str, str]
    file: dict[str, str]

    @property
    def bits(self) -> Literal[8, 16]:
        """Bits of the codes that the writer takes."""
        return 8 if self.pixels == "yuv420p" else 16


VIDEOS = {
    ".mp4": Container(format="mp4", codec="libx264", stream=_H264, file=_FAST_START),
    ".mkv": Container(format="matroska", codec="libx264", stream=_H264, file={}),
    ".webm": Container(format="webm", codec="libvpx-vp9", stream={"crf": "20", "b": "0", "row-mt": "1"}, file={}),
    # Editing programs expect the vendor "apl0" in a ProRes stream.
    ".mov": Container(
        format="mov",
        codec="prores_ks",
        pixels="yuv422p10le",
        stream={"profile": "hq", "vendor": "apl0"},
        file=_FAST_START,
    ),
}


def require_av(need: str = "movies need PyAV") -> ModuleType:
    """Import PyAV.

    Args:
        need: beginning of the message.

    Raises:
        MissingExtraError: it is not installed.
    """
    with extra(need, "[movie]", reason=True):
        import av
    module: ModuleType = av
    return module


def require_encoder(suffix: str) -> None:
    """Check that PyAV can write a kind of movie; it may be built without an encoder.

    Args:
        suffix: one of VIDEOS.

    Raises:
        MissingExtraError: PyAV lacks the encoder or the container.
    """
    if can_make(suffix):
        return
    others = [other for other in VIDEOS if can_make(other)]
    choose = f"; {', '.join(others)} can be made here" if others else ""
    raise MissingExtraError(
        f"{suffix}: PyAV is built without {VIDEOS[suffix].codec} here; this brings a build that has it: "
        f"{install_command('--force-reinstall av')}{choose}"
    )


def can_make(suffix: str) -> bool:
    """Return whether PyAV has the encoder and the container of a kind of movie.

    Args:
        suffix: one of VIDEOS.

    Raises:
        MissingExtraError: PyAV is not installed.
    """
    av, kind = require_av(), VIDEOS[suffix]
    try:
        av.Codec(kind.codec, "w")
        av.ContainerFormat(kind.format, "w")
    except ValueError:
        return False
    return True


def movie_frame(codes: NDArray[Any], width: int, height: int) -> Any:
    """Convert a picture to the pixel format and the size of a movie; odd sizes grow by one row or column.

    Args:
        codes: (h, w, 3) uint8 for yuv420p, uint16 for yuv422p10le.
        width, height: of the movie, pixels.
    """
    av = require_av()
    more = (height - codes.shape[0], width - codes.shape[1])
    if any(more):
        codes = np.pad(codes, ((0, more[0]), (0, more[1]), (0, 0)), mode="edge")
    if codes.dtype == np.uint8:
        frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(codes), format="rgb24")
        # The default matrix, of Rec. 601, would shift greens and reds.
        return frame.reformat(format="yuv420p", dst_colorspace="ITU709", dst_color_range="MPEG")
    frame = av.VideoFrame(width, height, "yuv422p10le")
    for plane, values in zip(frame.planes, planes_422_10(codes), strict=True):
        rows = np.zeros((plane.height, plane.line_size // 2), "<u2")
        rows[:, : values.shape[1]] = values
        plane.update(rows.tobytes())
    # ProRes reads colour attributes from each picture, not from the stream.
    frame.colorspace = _BT709
    with suppress(AttributeError):  # older PyAV lacks these two
        frame.color_primaries = frame.color_trc = _BT709
    return frame


def write_video(target: Path, pictures: Iterable[NDArray[Any]], width: int, height: int, fps: Fraction) -> None:
    """Write a movie; it appears under its name once it is whole, and leaves nothing after a failure.

    Args:
        target: its suffix, one of VIDEOS, decides the format.
        pictures: (height, width, 3) codes of each frame, uint8 or uint16 according to `Container.bits`.
        fps: frames per second, kept exactly.

    Raises:
        MissingExtraError: PyAV is not installed.
        OutputError: the movie cannot be written.
    """
    av = require_av()
    kind = VIDEOS[target.suffix.lower()]
    with whole_file(target) as part:
        try:
            container = av.open(str(part), "w", format=kind.format, options=kind.file)
        except av.FFmpegError as error:
            raise OutputError(f"{target}: cannot be written: {error.strerror}") from error
        try:
            stream = container.add_stream(kind.codec, rate=fps, options=kind.stream)
            # A chroma sample covers two columns, in yuv420p also two rows.
            stream.width = width + width % 2
            stream.height = height + (height % 2 if kind.pixels == "yuv420p" else 0)
            stream.pix_fmt = kind.pixels
            stream.time_base = 1 / fps
            context = stream.codec_context
            context.color_primaries = context.color_trc = context.colorspace = _BT709
            context.color_range = 1  # "limited": 16 to 235 in 8 bits
            for k, codes in enumerate(pictures):
                frame = movie_frame(codes, context.width, context.height)
                frame.pts, frame.time_base = k, 1 / context.framerate
                container.mux(stream.encode(frame))
            container.mux(stream.encode(None))  # the frames that the encoder still holds
            container.close()  # writes the index
        except BaseException as error:
            with suppress(av.FFmpegError):  # closing writes as well
                container.close()
            if isinstance(error, av.FFmpegError):
                raise OutputError(f"{target}: cannot be written: {error.strerror}") from error
            raise
