"""GIF, WebP and AVIF animations, one kind of target of `movie.py`: Pillow writes them."""

from collections.abc import Iterable, Iterator
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

from framearray_cli.base.arrays import Bytes
from framearray_cli.base.errors import MissingExtraError, OutputError
from framearray_cli.base.extras import install_command
from framearray_cli.base.files import whole_file

if TYPE_CHECKING:
    from PIL.Image import Image

# AVIF: speed 0 slow to 10; 6 needs nine times as long, for a fifth less error. All chroma is kept.
# WebP: method 0 fast to 6 small; every frame is a key frame.
OPTIONS: dict[str, dict[str, Any]] = {
    ".gif": {"optimize": False},
    ".webp": {"quality": 90, "method": 4, "kmin": 0, "kmax": 1},
    ".avif": {"quality": 80, "speed": 8, "subsampling": "4:4:4"},
}
GIF_FASTEST = 50  # frames per second; browsers play faster animations at a tenth of their rate
WEBP_LARGEST = 16383  # pixels
WEBP_LONGEST = 2**24 - 1  # ms of one frame
ANIMATIONS = (".gif", ".webp", ".avif")


def delays(n: int, fps: Fraction, units: int) -> list[int]:
    """Return the lengths of n frames in whole units of time; each frame ends within half a unit of its exact time."""
    ends = [round(k * units / fps) for k in range(n + 1)]
    return [end - start for start, end in pairwise(ends)]


def require_animation(suffix: str) -> None:
    """Check that Pillow can write a kind of animation.

    Args:
        suffix: one of ANIMATIONS.

    Raises:
        MissingExtraError: Pillow is built without it.
    """
    import PIL.features

    if suffix != ".gif" and not PIL.features.check(suffix[1:]):
        raise MissingExtraError(
            f"Pillow is built without {'WebP' if suffix == '.webp' else 'AVIF'} here; choose another kind, or install "
            f"a build that has it with: {install_command('--force-reinstall Pillow')}"
        )


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
        more = {"append_images": others, "duration": lengths, "loop": 0, **OPTIONS[suffix]}
        first.save(file, suffix[1:].upper(), save_all=True, **more)
