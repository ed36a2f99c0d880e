"""Values of a job that change no pixel, in an array that exists: its manifest, and the headers of its files.

The frame rate is in the header of every EXR and PNG; replacing it there leaves every other byte as it is, and gives the
bytes that a render at the new rate writes. A journal next to the records names the rates that files may have while
headers are rewritten. After an interruption the next run reads the journal and ends with one rate: a file counts as
whole if it has the recorded checksum at one of these rates.
"""

import json
import re
import struct
import zlib
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import data_digest, reason, require_file, write_bytes
from framearray_cli.base.threads import TaskPool
from framearray_cli.base.units import frame_rate

from .integrity import list_present
from .manifest import Manifest, array_files
from .manifest_toml import write_manifest
from .record import FOLDER, read_records, rewrite_checksums

JOURNAL = "rates.json"  # in the folder of the records, while headers are rewritten
HOLD_RATE = (".exr", ".png")  # files whose headers hold the frame rate

LOSSLESS = ("none", "rle", "zip", "zips", "piz")  # kinds of compression: each file names its own, and holds all pixels

# Keys that files depend on only if another key of their table has one of these values.
NEEDS: dict[tuple[str, str], tuple[str, Collection[object]]] = {
    ("output", "compression"): ("format", ("exr",)),
    ("output", "half"): ("format", ("exr",)),
    ("output", "quality"): ("format", ("jpg",)),
    ("output", "exposure"): ("format", ("png", "jpg")),
    ("output", "fps"): ("format", ()),  # files hold it, but no pixel depends on it
    ("obscurance", "tau"): ("falloff", ("exponential",)),
}
RATE = b"framesPerSecond"  # OpenEXR's name; PNG has it as text
_EXR, _PNG = b"\x76\x2f\x31\x01", b"\x89PNG\r\n\x1a\n"
_HEAD, _WORD, _CHUNK, _RATIONAL = 8, 4, 12, struct.Struct("<iI")


def metadata_of(job: Mapping[str, Any]) -> dict[tuple[str, str], Any]:
    """Return the values of a job's table that change no pixel: (table, key) -> value."""
    found = {}
    for (section, key), (other, values) in NEEDS.items():
        table = job.get(section)
        if isinstance(table, Mapping) and key in table and table.get(other) not in values:
            found[section, key] = table[key]
    output = job.get("output")
    if isinstance(output, Mapping) and output.get("compression") in LOSSLESS:
        found["output", "compression"] = output["compression"]
    return found


def metadata_differs(old: Manifest, job: Mapping[str, Any], fps: float) -> bool:
    """Return whether an array must take over values of a job, or a run that did so was interrupted."""
    return old.fps != fps or metadata_of(old.job) != metadata_of(job) or was_interrupted(old.directory)


def other_compression(old: Manifest, job: Mapping[str, Any]) -> str | None:
    """Return the lossless compression that a job wants of EXR files, if the array has another one."""
    new = metadata_of(job).get(("output", "compression"))
    is_exr = job.get("output", {}).get("format") == "exr"
    return new if is_exr and new != metadata_of(old.job).get(("output", "compression")) else None


def was_interrupted(folder: Path) -> bool:
    """Return whether the headers of an array may hold several frame rates."""
    return (folder / FOLDER / JOURNAL).exists()


def take_over_metadata(
    old: Manifest,
    job: dict[str, Any],
    fps: float,
    threads: int = 1,
    rewriting: Callable[[int], None] = lambda files: None,
) -> None:
    """Write the values of a job that change no pixel into an array; no run may render into it meanwhile.

    Args:
        rewriting: called with the number of files before the first header is rewritten.

    Raises:
        OutputError: a file cannot be read or written.
    """
    folder = old.directory
    if old.fps != fps or was_interrupted(folder):
        journal = folder / FOLDER / JOURNAL
        rates = _read_rates(journal) | {frame_rate(old.fps), frame_rate(fps)}
        write_bytes(journal, json.dumps([str(rate) for rate in sorted(rates)]).encode())
        _rewrite_headers(old, rates, frame_rate(fps), threads, rewriting)
    write_manifest(folder, replace(old, fps=fps, job=job))
    with suppress(FileNotFoundError):
        (folder / FOLDER / JOURNAL).unlink()


def _read_rates(journal: Path) -> set[Fraction]:
    """Read the rates that files may have; none if there is no journal, or it is damaged.

    Raises:
        OutputError: it is no file.
    """
    require_file(journal, "; remove it")
    try:
        return {read_rate(rate) for rate in json.loads(journal.read_bytes())}
    except (OSError, ValueError, TypeError, ZeroDivisionError, RecursionError):
        return set()


def _rewrite_headers(
    manifest: Manifest,
    rates: Collection[Fraction],
    rate: Fraction,
    threads: int,
    rewriting: Callable[[int], None],
) -> None:
    """Give all files one rate, then correct the records; damaged files stay as they are."""
    folder, present = manifest.directory, list_present(manifest)
    known = read_records(folder, manifest.fingerprint).checksums()
    files = [file for file in array_files(manifest) if file.suffix in HOLD_RATE and present.has([file])]
    rewriting(len(files))

    def rewrite(file: Path) -> tuple[str, tuple[int, str]] | None:
        try:
            data = file.read_bytes()
        except OSError as error:
            raise OutputError(f"{file}: cannot be read: {reason(error)}") from error
        recorded, own = known.get(file.name), frame_rate_of(data)
        if own is None:
            return None
        if recorded and not any(data_digest(with_frame_rate(data, other)) == recorded for other in (own, *rates)):
            return None
        new = with_frame_rate(data, rate)
        if new != data:
            write_bytes(file, new)
        return (file.name, data_digest(new)) if recorded else None

    with TaskPool(threads, thread_name_prefix="headers") as pool:
        found = dict(entry for entry in pool.map(rewrite, files) if entry)
    rewrite_checksums(folder, found)


def frame_rate_of(data: bytes) -> Fraction | None:
    """Return the frames per second in an image file; None if it holds none, or is damaged."""
    try:
        if data.startswith(_EXR):
            return next((Fraction(*_RATIONAL.unpack_from(data, at)) for at in _exr_rates(data)), None)
        if data.startswith(_PNG):
            return next((read_rate(text.decode("ascii")) for _, _, text in _png_rates(data)), None)
    except (ValueError, ZeroDivisionError, struct.error):
        return None
    return None


def read_rate(text: str) -> Fraction:
    """Read a rate as `str` writes it, "24" or "24000/1001".

    Raises:
        ValueError, ZeroDivisionError: the text is no such fraction of two numbers of at most nine digits.
    """
    if not re.fullmatch(r"\d{1,9}(/\d{1,9})?", text, re.ASCII):
        raise ValueError(f"expected a rate such as 24000/1001, got {text[:60]!r}")
    return Fraction(text)


def with_frame_rate(data: bytes, rate: Fraction) -> bytes:
    """Return an image file with another frame rate; as it is if it holds none."""
    if frame_rate_of(data) in (None, rate):
        return data
    if data.startswith(_EXR):
        at = next(_exr_rates(data))
        return data[:at] + _RATIONAL.pack(rate.numerator, rate.denominator) + data[at + _RATIONAL.size :]
    start, end, _ = next(_png_rates(data))
    body = b"tEXt" + RATE + b"\0" + str(rate).encode()
    return data[:start] + struct.pack(">I", len(body) - _WORD) + body + struct.pack(">I", zlib.crc32(body)) + data[end:]


def _exr_rates(data: bytes) -> Iterator[int]:
    """Yield where the rate stands among the attributes of an EXR: name, type, size, value; an empty name ends them."""
    at = _HEAD
    while (name_end := data.index(b"\0", at)) > at:
        type_end = data.index(b"\0", name_end + 1)
        (size,) = struct.unpack_from("<i", data, type_end + 1)
        value = type_end + 1 + _WORD
        if data[at:name_end] == RATE and data[name_end + 1 : type_end] == b"rational" and size == _RATIONAL.size:
            yield value
        if size < 0:
            raise ValueError("an attribute of negative size")
        at = value + size


def _png_rates(data: bytes) -> Iterator[tuple[int, int, bytes]]:
    """Yield start, end and text of each chunk of a PNG that holds the rate."""
    at = _HEAD
    while at + _CHUNK <= len(data):
        size, kind = struct.unpack_from(">I4s", data, at)
        end = at + _CHUNK + size
        keyword, _, text = data[at + 2 * _WORD : end - _WORD].partition(b"\0")
        if kind == b"tEXt" and keyword == RATE:
            yield at, end, text
        at = end
