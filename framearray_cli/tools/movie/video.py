"""Videos and animations, the files of movies.

Videos need PyAV, the optional extra `movie`; Pillow writes animations: GIF, WebP and AVIF.
"""

from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Bytes
from framearray_cli.base.errors import MissingExtraError, OutputError
from framearray_cli.base.extras import extra, install_command
from framearray_cli.base.files import whole_file

if TYPE_CHECKING:
    from PIL.Image import Image

K_R, K_B = 0.2126, 0.0722  # shares of red and blue in luma
LUMA_BLACK, LUMA_STEPS = 64, 876  # Y' from 64 to 940
CHROMA_ZERO, CHROMA_STEPS = 512, 896  # Cb and Cr from 64 to 960
# crf: quality, lower is better. faststart: the index comes first, so that a browser plays while it loads.
_H264 = {"crf": "16", "preset": "medium"}
_FAST_START = {"movflags": "+faststart"}
_BT709 = 1  # the number in H.264, VP9 and ProRes of the primaries, curve and matrix of Rec. 709
# AVIF: speed 0 slow to 10; 6 needs nine times as long, for a fifth less error. All chroma is kept.
# WebP: method 0 fast to 6 small; every frame is a key frame.
ANIMATION_OPTIONS: dict[str, dict[str, Any]] = {
    ".gif": {"optimize": False},
    ".webp": {"quality": 90, "method": 4, "kmin": 0, "kmax": 1},
    ".avif": {"quality": 80, "speed": 8, "subsampling": "4:4:4"},
}
GIF_FASTEST = 50  # frames per second; browsers play faster animations at a tenth of their rate
WEBP_LARGEST = 16383  # pixels
WEBP_LONGEST = 2**24 - 1  # ms of one frame
ANIMATIONS = (".gif", ".webp", ".avif")


def planes_422_10(codes: NDArray[np.uint16]) -> tuple[NDArray[np.uint16], NDArray[np.uint16], NDArray[np.uint16]]:
    """Convert a picture; chroma lies on even columns, with weights 1-2-1 of their neighbourhood.

    Args:
        codes: (h, w, 3) uint16, w even.

    Returns:
        Y' of shape (h, w), Cb and Cr of shape (h, w / 2).
    """
    r, g, b = (codes[..., i].astype(np.float32) / 65535 for i in range(3))
    y = K_R * r + (1 - K_R - K_B) * g + K_B * b
    chroma = np.stack([(b - y) / (2 * (1 - K_B)), (r - y) / (2 * (1 - K_R))])
    wide = np.pad(chroma, ((0, 0), (0, 0), (1, 1)), mode="edge")
    halved = wide[..., :-2:2] / 4 + wide[..., 1:-1:2] / 2 + wide[..., 2::2] / 4
    cb, cr = np.rint(CHROMA_ZERO + CHROMA_STEPS * halved).astype(np.uint16)
    return np.rint(LUMA_BLACK + LUMA_STEPS * y).astype(np.uint16), cb, cr


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
    """Check that a kind of movie can be written; libraries may be built without an encoder.

    Args:
        suffix: one of VIDEOS or ANIMATIONS.

    Raises:
        MissingExtraError: PyAV is not installed, or a library lacks the encoder or the container.
    """
    if can_make(suffix):
        return
    if suffix in ANIMATIONS:
        raise MissingExtraError(
            f"Pillow is built without {'WebP' if suffix == '.webp' else 'AVIF'} here; choose another kind, or install "
            f"a build that has it with: {install_command('--force-reinstall Pillow')}"
        )
    others = [other for other in VIDEOS if can_make(other)]
    choose = f"; {', '.join(others)} can be made here" if others else ""
    raise MissingExtraError(
        f"{suffix}: PyAV is built without {VIDEOS[suffix].codec} here; this brings a build that has it: "
        f"{install_command('--force-reinstall av')}{choose}"
    )


def can_make(suffix: str) -> bool:
    """Return whether PyAV or Pillow has the encoder and the container of a kind of movie.

    Args:
        suffix: one of VIDEOS or ANIMATIONS.

    Raises:
        MissingExtraError: PyAV is not installed.
    """
    if suffix in ANIMATIONS:
        import PIL.features

        return suffix == ".gif" or bool(PIL.features.check(suffix[1:]))
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


def encoded(encoder: Any, pictures: Iterable[NDArray[Any]], time_base: Fraction) -> Iterator[Any]:
    """Yield the packets of all frames of an encoder or a stream; see `movie_frame`."""
    for k, codes in enumerate(pictures):
        frame = movie_frame(codes, encoder.width, encoder.height)
        frame.pts, frame.time_base = k, time_base
        yield from encoder.encode(frame)
    yield from encoder.encode(None)  # the frames that the encoder still holds


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
                for packet in encoded(stream, pictures, 1 / context.framerate):
                    container.mux(packet)
                container.close()  # writes the index
            except BaseException:
                with suppress(av.FFmpegError):  # closing writes as well
                    container.close()
                raise
        except av.FFmpegError as error:
            raise OutputError(f"{target}: cannot be written: {error.strerror}") from error


def delays(n: int, fps: Fraction, units: int) -> list[int]:
    """Return the lengths of n frames in whole units of time; each frame ends within half a unit of its exact time."""
    ends = [round(k * units / fps) for k in range(n + 1)]
    return [end - start for start, end in pairwise(ends)]


class _Rest:
    """All frames but the first as one Pillow image of many frames, each made when Pillow reaches it."""

    def __init__(self, first: "Image", others: "Iterator[Image]", n_others: int) -> None:
        self.n_frames = n_others
        self._frame, self._others = first, others
        self._next = 0

    def seek(self, frame: int) -> None:
        """Go to a frame; Pillow goes through them in order."""
        if frame == self.n_frames:
            raise EOFError
        if frame == self._next:
            self._frame = next(self._others)
            self._next += 1

    def __getattr__(self, name: str) -> Any:
        return getattr(self._frame, name)


def _images(pictures: Iterable[Bytes], *, dithers: bool) -> "Iterator[Image]":
    """Convert pictures for Pillow; the same array twice in a row is converted once."""
    import PIL.Image

    last = None
    for codes in pictures:
        if codes is not last:
            image, last = PIL.Image.fromarray(codes), codes
            if dithers:  # each frame has its own 256 colours
                colours = image.quantize(256, PIL.Image.Quantize.MEDIANCUT)
                image = image.quantize(palette=colours, dither=PIL.Image.Dither.FLOYDSTEINBERG)
        yield image


def write_animation(
    target: Path, pictures: Iterable[Bytes], width: int, height: int, fps: Fraction, n_frames: int
) -> None:
    """Write an animation that loops for ever; it appears under its name once it is whole.

    Args:
        target: its suffix, one of ANIMATIONS, decides the format.
        pictures: (height, width, 3) codes of each frame, which must not change; each is read when it is encoded.

    Raises:
        OutputError: the system refuses to write, or the format has no room for the animation.
    """
    suffix = target.suffix.lower()
    step = 10 if suffix == ".gif" else 1  # ms
    lengths = [step * n for n in delays(n_frames, fps, 1000 // step)]
    if suffix == ".gif" and fps > GIF_FASTEST:
        raise OutputError(
            f"{target}: expected at most {GIF_FASTEST} frames per second, got {float(fps):g}: viewers play faster GIFs "
            "too slowly; choose another rate or .webp"
        )
    if suffix == ".webp" and (max(width, height) > WEBP_LARGEST or max(lengths) > WEBP_LONGEST):
        raise OutputError(
            f"{target}: WebP holds up to {WEBP_LARGEST} pixels per side, and {WEBP_LONGEST} ms per frame; choose "
            "another format"
        )
    images = _images(pictures, dithers=suffix == ".gif")
    with whole_file(target) as part, part.open("wb") as file:  # Pillow's own stays open after an interrupt
        first = next(images)
        others = [_Rest(first, images, n_frames - 1)] if n_frames > 1 else []
        more = {"append_images": others, "duration": lengths, "loop": 0, **ANIMATION_OPTIONS[suffix]}
        first.save(file, suffix[1:].upper(), save_all=True, **more)
