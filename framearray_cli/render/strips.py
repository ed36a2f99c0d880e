"""Strips of rows of all frames, of which one is rendered after the other if memory is short."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from framearray_cli import __version__
from framearray_cli.array.images import ImageFormat
from framearray_cli.array.stripfiles import known_strips, strip_file
from framearray_cli.base.files import fingerprint

DIGITS = 16  # of a key in names of files


@dataclass(frozen=True, slots=True, kw_only=True)
class Strips:
    """The strips of frames, of which one is rendered now.

    Attributes:
        all: their rows, from top to bottom; `now`: the number of this one.
        key: of all that rows depend on.
        directory: of the array.
        still: the camera never moves; its only frame, of camera 0, serves all cameras.
    """

    all: tuple[range, ...]
    now: int
    key: str
    directory: Path
    still: bool

    @property
    def rows(self) -> range:
        """The rows of this strip."""
        return self.all[self.now]

    @property
    def is_last(self) -> bool:
        """True if frames are joined and written."""
        return self.now == len(self.all) - 1

    def file(self, c: int, k: int) -> Path:
        """The file of strip k of camera c."""
        return strip_file(self.directory, self.key, c, self.all[k])

    def files(self, wanted: Sequence[int]) -> set[Path]:
        """The files of this strip; none of the last one, whose frames are written at once."""
        return set() if self.is_last else {self.file(c, self.now) for c in ([0] if self.still else wanted)}

    def missing(self, wanted: Sequence[int]) -> list[int]:
        """The cameras of which this strip is still to be rendered."""
        if self.is_last:
            return list(wanted)
        known = known_strips(self.directory, self.key)
        found = [
            c for c in ([0] if self.still else wanted) if (self.rows.start, self.rows.stop) not in known.get(c, ())
        ]
        return list(wanted) if self.still and found else found


def whole_frames(directory: Path, height: int) -> Strips:
    """Return the only strip of frames that are rendered as a whole."""
    return Strips(all=(range(height),), now=0, key="", directory=directory, still=False)


def strips_key(image_format: ImageFormat, array: str, cells: str, planes: range) -> str:
    """Return the key of the rows of an array.

    Args:
        array: fingerprint of job and scene; `cells`: digest of its cells.
    """
    parts = array, cells, __version__, repr(image_format), repr(planes)
    return fingerprint(*(part.encode() for part in parts)).rpartition(":")[2][:DIGITS]
