"""Rows of images: strips and slices of frames, and what is stored of rows until their image is written.

Strips are rendered one after the other if memory is short; slices of them are composed and coded one after the other,
so that no position needs a whole image in memory. Rows wait until the last of them is there, the rows of strips, and
of slices that are not coded, in files of their own. They wait in the form in which their image will be written, so that
an image has the same bytes however its rows are divided.
"""

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from framearray_cli import __version__
from framearray_cli.array.exr import Attributes, encode_chunked_exr, is_plain
from framearray_cli.array.images import (
    FOR_SCREENS,
    HALF_MAX,
    ImageFormat,
    codes_of,
    read_image,
    write_codes,
    write_image,
)
from framearray_cli.array.stripfiles import StripFile, strip_file
from framearray_cli.base.arrays import Float32, Image, Images
from framearray_cli.base.files import fingerprint, write_bytes
from framearray_cli.engine.features.aov import Matte
from framearray_cli.engine.images.compose import Composed
from framearray_cli.engine.images.dwa import CODED, LINES, dwa_chunks
from framearray_cli.job.job import Job

# What is stored of the rows of an image: chunks of DWA, codes of a screen, or numbers.
STORED = CHUNKS, SIZES, CODES, NUMBERS = "chunks", "sizes", "codes", "numbers"
ALPHA = "alpha"
DIGITS = 16  # of a key in names of files
# Bytes of the images of a slice, about, or of its smallest number of rows; where rows wait in files.
SLICE_BYTES, FILED_BYTES = 64 * 2**20, 256 * 2**20

Rows: TypeAlias = dict[str, NDArray[Any]]
Part: TypeAlias = Rows | StripFile  # arrays of some rows: what is stored of images and layers, by name


def image_format(job: Job) -> ImageFormat:
    """Return the image format of a job."""
    out = job.output
    return ImageFormat(
        format=out.format, compression=out.compression, half=out.half, quality=out.quality, exposure=out.exposure
    )


def write_stored(
    path: Path,
    image: Images,
    image_format: ImageFormat,
    attributes: Attributes,
    more: Mapping[str, Image],
    alpha: Float32 | None,
) -> None:
    """Write an image of an array as `write_image` does, but with the faster encoder of DWA where it can."""
    if image.dtype == np.float16 and has_own_dwa(image_format, attributes, alpha) and not more:
        coded, size = _coded(image, image_format.compression), (image.shape[1], image.shape[0])
        write_bytes(path, _encoded(coded, size, attributes, image_format.compression))
    else:
        write_image(path, image, image_format, attributes, more, alpha)


def has_own_dwa(image_format: ImageFormat, attributes: Attributes, alpha: Float32 | None) -> bool:
    """Return True if our own encoder of DWA writes images of halves."""
    dwa = image_format.composes_halves and image_format.compression in LINES
    return dwa and alpha is None and is_plain(attributes)


def slices_of(job: Job, rows: range, n_planes: int) -> list[range]:
    """Cut rows into slices that are composed and coded one after the other.

    The halves of a pixel need the frame as a whole, see `standard_error.py`.
    """
    if job.samples.halves:
        return [rows]
    row_bytes = (6 if image_format(job).composes_halves else 12) * job.camera.resolution[0] * n_planes
    step = max((SLICE_BYTES if codes_rows(job) else FILED_BYTES) // (row_bytes * CODED), 1) * CODED
    return [range(first, min(first + step, rows.stop)) for first in range(rows.start, rows.stop, step)]


def codes_rows(job: Job) -> bool:
    """Return True if the rows of images are coded before the rest is there: for screens, and in DWA."""
    kind = image_format(job)
    dwa = has_own_dwa(kind, {}, None) and not job.output.alpha and _divides(kind.compression)
    return dwa or kind.format in FOR_SCREENS


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
    now: int = 0
    key: str = ""
    directory: Path
    still: bool = False

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
        found = [c for c in ([0] if self.still else wanted) if not self.file(c, self.now).exists()]
        return list(wanted) if self.still and found else found


def strips_key(image_format: ImageFormat, array: str, cells: str, planes: range) -> str:
    """Return the key of the rows of an array.

    Args:
        array: fingerprint of job and scene; `cells`: digest of its cells.
    """
    parts = array, cells, __version__, repr(image_format), repr(planes)
    return fingerprint(*(part.encode() for part in parts)).rpartition(":")[2][:DIGITS]


def stored_rows(
    image: Images, image_format: ImageFormat, attributes: Attributes, alpha: Float32 | None, *, whole: bool, keep: bool
) -> Rows:
    """Return rows of an image (h, w, 3) as they are stored.

    Args:
        alpha: (h, w), see `write_image`.
        whole: whether these are all rows, and not the rows of a strip or a slice.
        keep: whether the memory of `image` is kept until it is written.
    """
    compression = image_format.compression
    if image_format.format in FOR_SCREENS:
        return {CODES: codes_of(np.asarray(image, np.float32), image_format, alpha)}
    if not has_own_dwa(image_format, attributes, alpha) or not (whole or _divides(compression)):
        return {NUMBERS: image if keep else image.copy()}
    if image.dtype == np.float16 or image.max() <= HALF_MAX:
        return _coded(image, compression)
    # The image will have floats. What fits into halves loses what it would lose in another slice or strip.
    found = []
    for first in range(0, len(image), CODED):
        part = image[first : first + CODED]
        fits = part.max() <= HALF_MAX
        found.append(_numbers(_coded(part, compression), part.shape, compression) if fits else part)
    return {NUMBERS: np.concatenate(found)}


def join_rows(parts: Sequence[Part], rows: Sequence[range], width: int, compression: str, p: int) -> Rows:
    """Return the rows of image p in all parts together."""
    found = [{name: part[f"{name}-{p}"] for name in STORED if f"{name}-{p}" in part} for part in parts]
    if len(found) == 1:
        return found[0]
    if any(NUMBERS in part for part in found):
        shapes = [(len(own), width, 3) for own in rows]
        numbers = [_numbers(part, shape, compression) for part, shape in zip(found, shapes, strict=True)]
        return {NUMBERS: np.concatenate(numbers)}
    return {name: np.concatenate([part[name] for part in found]) for name in found[0]}


def write_rows(
    path: Path,
    rows: Rows,
    size: tuple[int, int],
    image_format: ImageFormat,
    attributes: Attributes,
    more: Mapping[str, Image],
    alpha: Float32 | None,
) -> None:
    """Write an image of all its rows.

    Args:
        size: width and height.
        more, alpha: see `write_image`.
    """
    if CODES in rows:
        write_codes(path, rows[CODES], image_format, attributes)
    elif CHUNKS in rows:
        write_bytes(path, _encoded(rows, size, attributes, image_format.compression))
    else:
        write_stored(path, rows[NUMBERS], image_format, attributes, more, alpha)


def layers_of(composed: Composed) -> Rows:
    """Return the layers of some rows and their alpha, by name."""
    found: Rows = {} if composed.alpha is None else {ALPHA: composed.alpha}
    for name, values in composed.layers.items():
        if isinstance(values, Matte):
            found |= {f"number of {name}": values.number, f"coverage of {name}": values.coverage}
        else:
            found[name] = values
    return found


def join_layer(name: str, values: Any, parts: Sequence[Part]) -> Any:
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


def _divides(compression: str) -> bool:
    """Return True if chunks of a compression end where strips do."""
    return CODED % LINES[compression] == 0


def _coded(image: Images, compression: str) -> Rows:
    """Encode rows (h, w, 3) as chunks of DWA."""
    chunks = dwa_chunks(image.astype(np.float16, copy=False), LINES[compression])
    sizes = np.array([len(chunk) for chunk in chunks], np.int64)
    return {CHUNKS: np.frombuffer(b"".join(chunks), np.uint8), SIZES: sizes}


def _encoded(rows: Rows, size: tuple[int, int], attributes: Attributes, compression: str) -> bytes:
    """Join chunks of DWA to a file of EXR."""
    ends = np.cumsum([0, *rows[SIZES]])
    data = rows[CHUNKS].tobytes()
    chunks = [data[first:end] for first, end in pairwise(ends.tolist())]
    return encode_chunked_exr(chunks, LINES[compression], size, list("RGB"), attributes, compression)


def _numbers(rows: Rows, shape: tuple[int, ...], compression: str) -> Images:
    """Return rows as numbers."""
    if NUMBERS in rows:
        return np.asarray(rows[NUMBERS])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "rows.exr"
        write_bytes(path, _encoded(rows, (shape[1], shape[0]), {}, compression))
        return read_image(path)
