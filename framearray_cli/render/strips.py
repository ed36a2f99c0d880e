"""Frames that are coded slice by slice, and if memory is short rendered strip by strip.

No image is in memory as a whole: slices of rows are composed and coded one after the other, and the coded rows wait,
those of strips in files of their own, until the last of them is there. Rows wait in the form in which their image will
be written, so that an image has the same bytes with strips and without.
"""

import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from threading import Lock
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from framearray_cli import __version__
from framearray_cli.array.exr import Attributes, encode_chunked_exr
from framearray_cli.array.images import (
    FOR_SCREENS,
    HALF_MAX,
    ImageFormat,
    codes_of,
    pixel_shares,
    read_image,
    write_codes,
)
from framearray_cli.array.stripfiles import StripFile, known_strips, remove_strips, strip_file, write_strip
from framearray_cli.base.arrays import Float32, Images
from framearray_cli.base.files import fingerprint, write_bytes
from framearray_cli.engine.features.aov import Matte
from framearray_cli.engine.images.compose import Composed
from framearray_cli.engine.images.dwa import CODED, LINES, dwa_chunks
from framearray_cli.job.job import Job

from .writer import (
    ArrayTarget,
    ArrayWriter,
    Countdown,
    FinishedFiles,
    has_own_dwa,
    image_format,
    sum_shares,
    write_stored,
)

DIGITS = 16  # of a key in names of files
# What is stored of the rows of an image: chunks of DWA, codes of a screen, or numbers.
STORED = CHUNKS, SIZES, CODES, NUMBERS = "chunks", "sizes", "codes", "numbers"
ALPHA = "alpha"
CODING = 0.9  # of the work of writing an image, about; the rest joins what was coded
SLICE_BYTES = 64 * 2**20  # of the images of a slice, about, or of its smallest number of rows

Rows: TypeAlias = dict[str, NDArray[Any]]
Part: TypeAlias = Rows | StripFile


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


def coded_slices(job: Job, rows: range, n_planes: int) -> list[range]:
    """Cut rows into slices that are composed and coded one after the other; empty if the format cannot be coded so.

    TIFF, floats, alpha in EXR, error layers and other compressions than DWA need whole images, or whole strips.
    """
    kind = image_format(job)
    dwa = kind.composes_halves and kind.compression in LINES and not job.output.alpha and _divides(kind)
    if job.samples.halves or not (dwa or kind.format in FOR_SCREENS):
        return []
    row_bytes = (6 if kind.composes_halves else 12) * job.camera.resolution[0] * n_planes
    step = max(SLICE_BYTES // (row_bytes * CODED), 1) * CODED
    return [range(first, min(first + step, rows.stop)) for first in range(rows.start, rows.stop, step)]


def strips_key(target: ArrayTarget, array: str, cells: str, planes: range) -> str:
    """Return the key of the rows of an array.

    Args:
        array: fingerprint of job and scene; `cells`: digest of its cells.
    """
    parts = array, cells, __version__, repr(target.format), repr(planes)
    return fingerprint(*(part.encode() for part in parts)).rpartition(":")[2][:DIGITS]


@dataclass(slots=True, kw_only=True, eq=False)
class _Frame:
    """The rows of a frame that are composed so far, slice by slice from top to bottom.

    Attributes:
        slices: what is stored of each, and what the record says of it; `rows`: their rows.
        left: counts down what is still to be coded.
        last: the last slice, in a block that is free when the frame is written; `cameras`: that show the frame.
    """

    left: Countdown
    slices: list[Part] = field(default_factory=list)
    facts: list[dict[str, Any]] = field(default_factory=list)
    rows: list[range] = field(default_factory=list)
    last: tuple[Composed, Images] | None = None
    cameras: Sequence[int] = ()

    @property
    def end(self) -> tuple[Composed, Images]:
        """The last slice, once it is there."""
        assert self.last is not None
        return self.last


class StripWriter(ArrayWriter):
    """Codes frames slice by slice, and writes them once all of their slices and strips are there."""

    def __init__(self, strips: Strips, slices: Sequence[range], *given: Any) -> None:
        """Start the threads.

        Args:
            slices: the rows of this strip that are composed together.
            given: see `ArrayWriter`.
        """
        super().__init__(*given)
        self._strips, self._slices, self._frames = strips, slices, dict[int, _Frame]()

    def write(self, composed: Composed, cameras: Sequence[int], block: Images | None = None) -> None:
        block, c = composed.images if block is None else block, composed.c
        if c not in self._frames:
            self._frames[c] = _Frame(left=Countdown(len(self._slices), lambda: self._write_frame(frame)))
        frame, arrays, lock = self._frames[c], _arrays_of(composed), Lock()
        frame.slices.append(arrays)
        frame.rows.append(composed.rows)
        frame.facts.append({})
        facts, is_last = frame.facts[-1], composed.rows.stop == self._strips.rows.stop
        if is_last:
            frame.last, frame.cameras = (composed, block), cameras if self._strips.is_last else [c]
            del self._frames[c]

        def store(p: int) -> None:
            found = {f"{name}-{p}": array for name, array in self._stored(composed, p, keep=is_last).items()}
            with lock:
                arrays.update(found)

        def finish() -> None:
            facts.update(self._facts(composed))
            if not is_last:
                self._free.put(block)
            frame.left.count_down()

        share = CODING * len(composed.rows) / self._target.resolution[1]
        self._submit([(partial(store, p), share) for p in self._planes], finish)

    def _write_frame(self, frame: _Frame) -> None:
        """Write the rows of a strip, or a whole frame for each camera that shows it."""
        strips, (composed, block) = self._strips, frame.end
        if not strips.is_last:
            arrays = {name: np.concatenate([part[name] for part in frame.slices]) for name in _arrays_of(composed)}
            for p in self._planes:
                arrays |= {f"{kind}-{p}": array for kind, array in self._join(frame.slices, frame.rows, p).items()}
            write_strip(strips.file(composed.c, strips.now), frame.facts, arrays)
            self._free.put(block)
            return
        before = [StripFile(strips.file(composed.c, k)) for k in range(strips.now)]
        frame.slices[:0], frame.rows[:0] = before, strips.all[: strips.now]
        frame.facts[:0] = [facts for file in before for facts in file.facts]
        unfinished = Countdown(len(frame.cameras), lambda: self._free.put(block))
        alpha = None if composed.alpha is None else _join_layer(ALPHA, composed.alpha, frame.slices)
        layers = {name: _join_layer(name, values, frame.slices) for name, values in composed.layers.items()}
        for c in frame.cameras:
            self._write_camera_of(frame, c, layers, alpha, unfinished)

    def _write_camera_of(
        self, frame: _Frame, c: int, layers: Mapping[str, Any], alpha: Float32 | None, unfinished: Countdown
    ) -> None:
        """Write all files of a camera, then report them as finished."""
        strips, (composed, _), files = self._strips, frame.end, dict[str, tuple[int, str]]()
        write = partial(self._write_joined, frame, c, alpha)

        def finish() -> None:
            self._finished(self._joined(frame.facts, composed.c, c, files))
            if strips.now and not strips.still:  # other runs may need them
                remove_strips(strips.directory, [c])
            unfinished.count_down()

        tasks: list[tuple[Callable[[], None], float]] = [
            (partial(self._note, files, partial(write, p)), 1 - CODING) for p in self._planes
        ]
        if layers:
            tasks.append((partial(self._note, files, partial(self._write_layers, layers, c)), 0))
        self._submit(tasks, finish)

    def _stored(self, composed: Composed, p: int, *, keep: bool) -> Rows:
        """Return the rows of an image as they are stored.

        Args:
            keep: whether their memory is kept until the image is written.
        """
        image, kind, alpha = composed.images[p - self._planes.start], self._target.format, composed.alpha
        if kind.format in FOR_SCREENS:
            return {CODES: codes_of(image, kind, alpha)}
        halves = image[:0].astype(np.float16)  # what the encoder takes
        if not has_own_dwa(halves, kind, self._attributes(composed, composed.c, p), alpha) or not _divides(kind):
            return {NUMBERS: image if keep else image.copy()}
        if image.dtype == np.float16 or image.max() <= HALF_MAX:
            return _coded(image, kind)
        # The image will have floats. What fits into halves loses what it would lose in another slice or strip.
        parts = [image[first : first + CODED] for first in range(0, len(image), CODED)]
        fits = [part.max() <= HALF_MAX for part in parts]
        return {
            NUMBERS: np.concatenate(
                [_numbers(_coded(x, kind), x.shape, kind) if fit else x for x, fit in zip(parts, fits, strict=True)]
            )
        }

    def _join(self, parts: Sequence[Part], rows: Sequence[range], p: int) -> Rows:
        """Return the rows of image p in all parts together."""
        found = [{name: part[f"{name}-{p}"] for name in STORED if f"{name}-{p}" in part} for part in parts]
        if any(NUMBERS in part for part in found) and len(found) > 1:
            kind, width = self._target.format, self._target.resolution[0]
            shapes = [(len(own), width, 3) for own in rows]
            return {
                NUMBERS: np.concatenate(
                    [_numbers(part, shape, kind) for part, shape in zip(found, shapes, strict=True)]
                )
            }
        return {name: np.concatenate([part[name] for part in found]) for name in found[0]}

    def _write_joined(self, frame: _Frame, c: int, alpha: Float32 | None, p: int) -> Path:
        """Write an image of joined rows."""
        target, kind = self._target, self._target.format
        path, attributes = target.directory / target.names.images[p].file(c), self._attributes(frame.end[0], c, p)
        rows = self._join(frame.slices, frame.rows, p)
        if CODES in rows:
            write_codes(path, rows[CODES], kind, attributes)
        elif CHUNKS in rows:
            write_bytes(path, _encoded(rows, target.resolution, attributes, kind))
        else:
            write_stored(path, rows[NUMBERS], kind, attributes, {}, alpha)
        return path

    def _facts(self, composed: Composed) -> dict[str, Any]:
        """Return what the record of a frame says of some of its rows."""
        kind, sums = self._target.format, self._target.sums
        shares = sum_shares(composed.images, sums, kind, composed.alpha) or [
            pixel_shares(composed.images[p - self._planes.start], kind, composed.alpha)
            for p in self._planes
            if not self._target.names.images[p].group
        ]
        return {
            "share": len(composed.rows) / self._target.resolution[1],
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


def _divides(kind: ImageFormat) -> bool:
    """Return True if chunks of a compression end where strips do."""
    return CODED % LINES[kind.compression] == 0


def _coded(image: Images, kind: ImageFormat) -> Rows:
    """Encode rows (h, w, 3) as chunks of DWA."""
    chunks = dwa_chunks(image.astype(np.float16, copy=False), LINES[kind.compression])
    sizes = np.array([len(chunk) for chunk in chunks], np.int64)
    return {CHUNKS: np.frombuffer(b"".join(chunks), np.uint8), SIZES: sizes}


def _encoded(rows: Rows, size: tuple[int, int], attributes: Attributes, kind: ImageFormat) -> bytes:
    """Join chunks of DWA to a file."""
    ends = np.cumsum([0, *rows[SIZES]])
    data = rows[CHUNKS].tobytes()
    chunks = [data[first:end] for first, end in pairwise(ends.tolist())]
    return encode_chunked_exr(chunks, LINES[kind.compression], size, list("RGB"), attributes, kind.compression)


def _numbers(rows: Rows, shape: tuple[int, ...], kind: ImageFormat) -> Images:
    """Return rows as numbers."""
    if NUMBERS in rows:
        return np.asarray(rows[NUMBERS])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "rows.exr"
        write_bytes(path, _encoded(rows, (shape[1], shape[0]), {}, kind))
        return read_image(path)


def _arrays_of(composed: Composed) -> Rows:
    """Return the layers of a frame and its alpha, by name."""
    found: Rows = {} if composed.alpha is None else {ALPHA: composed.alpha}
    for name, values in composed.layers.items():
        if isinstance(values, Matte):
            found |= {f"number of {name}": values.number, f"coverage of {name}": values.coverage}
        else:
            found[name] = values
    return found


def _join_layer(name: str, values: Any, parts: Sequence[Part]) -> Any:
    """Return a layer of all parts together.

    Args:
        values: of one part.
    """
    if isinstance(values, Matte):
        number, coverage = (
            np.concatenate([part[f"{what} of {name}"] for part in parts]) for what in ("number", "coverage")
        )
        return replace(values, number=number, coverage=coverage)
    return np.concatenate([part[name] for part in parts])
