"""Frames whose rows are rendered strip by strip: rows wait in files of their own until the last strip joins them.

Rows wait in the form in which their image will be written, so that an image has the same bytes with strips and without.
"""

import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from framearray_cli import __version__
from framearray_cli.array.exr import encode_chunked_exr
from framearray_cli.array.images import FOR_SCREENS, codes_of, pixel_shares, read_image, write_codes
from framearray_cli.array.stripfiles import StripFile, known_strips, remove_strips, strip_file, write_strip
from framearray_cli.base.arrays import Float32, Images
from framearray_cli.base.files import fingerprint, write_bytes
from framearray_cli.engine.features.aov import Matte
from framearray_cli.engine.images.compose import Composed
from framearray_cli.engine.images.dwa import CODED, LINES, dwa_chunks

from .writer import ArrayTarget, ArrayWriter, Countdown, FinishedFiles, has_own_dwa, sum_shares, write_stored

DIGITS = 16  # of a key in names of files
# What is stored of the rows of an image: chunks of DWA, codes of a screen, or numbers.
CHUNKS, SIZES, CODES, NUMBERS = "chunks", "sizes", "codes", "numbers"

Rows = dict[str, NDArray[Any]]


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

    @property
    def share(self) -> float:
        """Share of the frame's rows."""
        return len(self.rows) / self.all[-1].stop

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


def strips_key(target: ArrayTarget, array: str, cells: str, planes: range) -> str:
    """Return the key of the rows of an array.

    Args:
        array: fingerprint of job and scene; `cells`: digest of its cells.
    """
    parts = array, cells, __version__, repr(target.format), repr(planes)
    return fingerprint(*(part.encode() for part in parts)).rpartition(":")[2][:DIGITS]


class StripWriter(ArrayWriter):
    """Writes strips of frames, and whole frames once all of their strips are there."""

    def __init__(self, strips: Strips, *given: Any) -> None:
        """Start the threads.

        Args:
            given: see `ArrayWriter`.
        """
        super().__init__(*given)
        self._strips = strips

    def write(self, composed: Composed, cameras: Sequence[int], block: Images | None = None) -> None:
        super().write(composed, cameras if self._strips.is_last else [composed.c], block)

    def _write_camera(self, composed: Composed, c: int, unfinished: Countdown) -> None:
        strips = self._strips
        arrays, lock = _arrays_of(composed), Lock()
        before = [StripFile(strips.file(composed.c, k)) for k in range(strips.now if strips.is_last else 0)]
        files: dict[str, tuple[int, str]] = {}

        def store(p: int) -> None:
            found = {f"{name}-{p}": array for name, array in self._stored(composed, c, p).items()}
            with lock:
                arrays.update(found)

        def finish() -> None:
            facts = self._facts(composed)
            if not strips.is_last:
                write_strip(strips.file(c, strips.now), facts, arrays)
            else:
                self._finished(self._joined([*(file.facts for file in before), facts], composed.c, c, files))
                if not strips.still:  # other runs may need them
                    remove_strips(strips.directory, [c])
            unfinished.count_down()

        if not strips.is_last:
            self._submit([(partial(store, p), strips.share) for p in self._planes], finish)
            return
        alpha = None if composed.alpha is None else np.concatenate([*(f["alpha"] for f in before), composed.alpha])
        layers = {name: _join_layer(name, values, before) for name, values in composed.layers.items()}
        tasks: list[tuple[Callable[[], None], float]] = [
            (partial(self._note, files, partial(self._write_joined, composed, c, p, before, alpha)), strips.share)
            for p in self._planes
        ]
        if layers:
            tasks.append((partial(self._note, files, partial(self._write_layers, layers, c)), 0))
        self._submit(tasks, finish)

    def _stored(self, composed: Composed, c: int, p: int) -> Rows:
        """Return the rows of an image as they are stored."""
        image, kind, alpha = composed.images[p - self._planes.start], self._target.format, composed.alpha
        if kind.format in FOR_SCREENS:
            return {CODES: codes_of(image, kind, alpha)}
        if has_own_dwa(image, kind, self._attributes(composed, c, p), alpha) and _divides(kind.compression):
            chunks = dwa_chunks(image, LINES[kind.compression])
            sizes = np.array([len(chunk) for chunk in chunks], np.int64)
            return {CHUNKS: np.frombuffer(b"".join(chunks), np.uint8), SIZES: sizes}
        return {NUMBERS: image}

    def _write_joined(
        self, composed: Composed, c: int, p: int, before: Sequence[StripFile], alpha: Float32 | None
    ) -> Path:
        """Join the rows of an image, and write it."""
        target, kind = self._target, self._target.format
        path = target.directory / target.names.images[p].file(c)
        attributes = self._attributes(composed, c, p)
        parts = [_read_rows(file, p) for file in before] + [self._stored(composed, c, p)]
        if all(CODES in part for part in parts):
            write_codes(path, np.concatenate([part[CODES] for part in parts]), kind, attributes)
        elif all(CHUNKS in part for part in parts):
            chunks, lines = [chunk for part in parts for chunk in _chunks(part)], LINES[kind.compression]
            size, channels = target.resolution, list("RGB")
            write_bytes(path, encode_chunked_exr(chunks, lines, size, channels, attributes, kind.compression))
        else:  # a strip has values beyond the largest half
            whole = np.concatenate([self._numbers(part, k) for k, part in enumerate(parts)])
            write_stored(path, whole, kind, attributes, {}, alpha)
        return path

    def _numbers(self, rows: Rows, k: int) -> Images:
        """Return the rows of an image in strip k as numbers."""
        if NUMBERS in rows:
            return np.asarray(rows[NUMBERS])
        compression, size = self._target.format.compression, (self._target.resolution[0], len(self._strips.all[k]))
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "rows.exr"
            write_bytes(path, encode_chunked_exr(_chunks(rows), LINES[compression], size, list("RGB"), {}, compression))
            return read_image(path)

    def _facts(self, composed: Composed) -> dict[str, Any]:
        """Return what the record of a frame says of some of its rows."""
        kind, sums = self._target.format, self._target.sums
        shares = sum_shares(composed.images, sums, kind, composed.alpha) or [
            pixel_shares(composed.images[p - self._planes.start], kind, composed.alpha)
            for p in self._planes
            if not self._target.names.images[p].group
        ]
        return {
            "share": self._strips.share,
            "hits": float(composed.hits.mean()),
            "bad": composed.bad,
            "first_bad": composed.first_bad,
            "shares": shares,
        }

    def _joined(
        self, facts: Sequence[Mapping[str, Any]], eye: int, c: int, files: Mapping[str, tuple[int, str]]
    ) -> FinishedFiles:
        """Return a finished frame."""
        weights = np.array([part["share"] for part in facts])
        shares = np.einsum(
            "k,kpi->pi", weights, np.array([part["shares"] for part in facts]).reshape(len(facts), -1, 2)
        )
        l, pixel = next((part["first_bad"] for part in facts if part["bad"]), (0, 0))
        return FinishedFiles(
            c=c,
            eye=eye,
            planes=self._planes,
            hits=float(weights @ [part["hits"] for part in facts]),
            bad=sum(part["bad"] for part in facts),
            first_bad=(l, pixel),
            files=files,
            errors={},
            shares=[(clipped, black) for clipped, black in shares.tolist()],
        )


def _divides(compression: str) -> bool:
    """Return True if chunks of a compression end where strips do."""
    return CODED % LINES[compression] == 0


def _arrays_of(composed: Composed) -> Rows:
    """Return the layers of a frame and its alpha, by name."""
    found: Rows = {} if composed.alpha is None else {"alpha": composed.alpha}
    for name, values in composed.layers.items():
        if isinstance(values, Matte):
            found |= {f"number of {name}": values.number, f"coverage of {name}": values.coverage}
        else:
            found[name] = values
    return found


def _join_layer(name: str, values: Any, before: Sequence[StripFile]) -> Any:
    """Return a layer of a whole frame: of the strips in files, and then of the last one."""
    if isinstance(values, Matte):
        number = np.concatenate([*(file[f"number of {name}"] for file in before), values.number])
        coverage = np.concatenate([*(file[f"coverage of {name}"] for file in before), values.coverage])
        return replace(values, number=number, coverage=coverage)
    return np.concatenate([*(file[name] for file in before), values])


def _read_rows(file: StripFile, p: int) -> Rows:
    """Return the rows of image p."""
    return {kind: file[f"{kind}-{p}"] for kind in (CHUNKS, SIZES, CODES, NUMBERS) if f"{kind}-{p}" in file}


def _chunks(rows: Rows) -> list[bytes]:
    """Return the chunks of DWA."""
    ends = np.cumsum([0, *rows[SIZES]])
    data = rows[CHUNKS].tobytes()
    return [data[first:end] for first, end in pairwise(ends.tolist())]
