"""GIF, WebP and AVIF animations, one kind of target of `movie.py`: Pillow writes them."""

from collections.abc import Iterator
from contextlib import contextmanager
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

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


class AnimationWriter:
    """An open animation; `open_animation` makes it. Pillow writes all frames at the end; a held one waits only once."""

    def __init__(self, suffix: str) -> None:
        self._dithers = suffix == ".gif"
        self._codes: NDArray[Any] | None = None
        self.frames: list[Image] = []

    def add(self, codes: NDArray[Any]) -> None:
        """Add one picture: (h, w, 3) uint8, which must not change; the same array twice in a row is one picture."""
        import PIL.Image

        if codes is self._codes:
            self.frames.append(self.frames[-1])
            return
        picture = PIL.Image.fromarray(codes)
        if self._dithers:  # each frame has its own 256 colours
            colours = picture.quantize(256, PIL.Image.Quantize.MEDIANCUT)
            picture = picture.quantize(palette=colours, dither=PIL.Image.Dither.FLOYDSTEINBERG)
        self._codes = codes
        self.frames.append(picture)


@contextmanager
def open_animation(target: Path, width: int, height: int, fps: Fraction, n_frames: int) -> Iterator[AnimationWriter]:
    """Open an animation that loops for ever; it appears under its name once it is whole.

    Args:
        target: its suffix, one of ANIMATIONS, decides the format.

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
    with whole_file(target) as part:
        writer = AnimationWriter(suffix)
        yield writer
        first, *others = writer.frames
        more = {"append_images": others, "duration": lengths, "loop": 0, **OPTIONS[suffix]}
        first.save(part, suffix[1:].upper(), save_all=True, **more)
