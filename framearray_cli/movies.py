"""Encode 8-bit pictures as a movie: the only door to PyAV, which is the optional extra `movie`."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from .arrays import Bytes
from .errors import MissingExtraError, OutputError
from .files import whole_file


@dataclass(frozen=True, slots=True, kw_only=True)
class Container:
    """How one kind of movie file is made.

    Attributes:
        format: the container's name, since a temporary file has no suffix of its own.
        codec: the encoder.
        stream: options of the encoder.
        file: options of the container.
    """

    format: str
    codec: str
    stream: dict[str, str]
    file: dict[str, str]


# crf is the quality, lower is better. faststart puts the index first, so that a browser plays while it loads.
_H264 = {"crf": "16", "preset": "medium"}
CONTAINERS = {
    ".mp4": Container(format="mp4", codec="libx264", stream=_H264, file={"movflags": "+faststart"}),
    ".mov": Container(format="mov", codec="libx264", stream=_H264, file={"movflags": "+faststart"}),
    ".mkv": Container(format="matroska", codec="libx264", stream=_H264, file={}),
    ".webm": Container(format="webm", codec="libvpx-vp9", stream={"crf": "20", "b": "0", "row-mt": "1"}, file={}),
}

_BT709 = 1  # the number that H.264 and VP9 give to the primaries, curve and matrix of Rec. 709


def require_av() -> ModuleType:
    """Import PyAV.

    Raises:
        MissingExtraError: it is not installed.
    """
    try:
        import av
    except ImportError as error:
        raise MissingExtraError(f'movies need PyAV ({error}); pip install "framearray[movie]"') from error
    module: ModuleType = av
    return module


class MovieWriter:
    """A movie that is being encoded; made by `open_movie`."""

    __slots__ = ("_container", "_n", "_stream")

    def __init__(self, container: Any, stream: Any) -> None:
        self._container = container
        self._stream = stream
        self._n = 0

    def add(self, codes: Bytes) -> None:
        """Add one picture: (h, w, 3) sRGB codes of the movie's size; odd sizes are padded by one row or column."""
        av = require_av()
        odd_rows, odd_columns = codes.shape[0] % 2, codes.shape[1] % 2
        if odd_rows or odd_columns:  # yuv420p holds one colour for 2 x 2 pixels
            codes = np.pad(codes, ((0, odd_rows), (0, odd_columns), (0, 0)), mode="edge")
        frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(codes), format="rgb24")
        # The default matrix is that of Rec. 601, which would shift greens and reds.
        frame = frame.reformat(format="yuv420p", dst_colorspace="ITU709", dst_color_range="MPEG")
        frame.pts = self._n
        frame.time_base = 1 / self._stream.codec_context.framerate
        self._n += 1
        self._container.mux(self._stream.encode(frame))

    def finish(self) -> None:
        """Write what the encoder still holds, and the index."""
        self._container.mux(self._stream.encode(None))
        self._container.close()


@contextmanager
def open_movie(target: Path, width: int, height: int, fps: Fraction) -> Iterator[MovieWriter]:
    """Open a movie that appears under its name once it is whole; on any failure nothing is left.

    Args:
        target: its suffix, one of CONTAINERS, decides the format.
        width: pixels of a picture, before padding.
        height: pixels of a picture, before padding.
        fps: frames per second, kept exactly.

    Raises:
        MissingExtraError: PyAV is not installed.
        OutputError: the movie cannot be written.
    """
    av = require_av()
    kind = CONTAINERS[target.suffix.lower()]
    with whole_file(target) as part:
        try:
            container = av.open(str(part), "w", format=kind.format, options=kind.file)
        except av.FFmpegError as error:
            raise OutputError(f"{target}: cannot be written: {error.strerror}") from error
        try:
            stream = container.add_stream(kind.codec, rate=fps, options=kind.stream)
            stream.width, stream.height = width + width % 2, height + height % 2
            stream.pix_fmt = "yuv420p"
            stream.time_base = 1 / fps
            context = stream.codec_context
            context.color_primaries = context.color_trc = context.colorspace = _BT709
            context.color_range = 1  # "limited": 16 to 235
            writer = MovieWriter(container, stream)
            yield writer
            writer.finish()
        except BaseException as error:
            with suppress(av.FFmpegError):  # closing writes, too
                container.close()
            if isinstance(error, av.FFmpegError):
                raise OutputError(f"{target}: cannot be written: {error.strerror}") from error
            raise
