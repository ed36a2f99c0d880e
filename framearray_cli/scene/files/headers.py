"""Check what a file claims of itself before trimesh reads it: counts, and the size of what would be unpacked."""

import io
import re
import zipfile
from collections.abc import Iterator

from framearray_cli.base.errors import SceneError
from framearray_cli.base.units import counted

from .assets import shorten
from .limit import Limit

ARCHIVES = ("3mf", "3dxml", "zae")  # each is a ZIP with XML in it
XML = ("dae", "xaml")
LONGEST_HEADER = 100_000  # bytes; comments take some, never this many
# Bytes per number of each PLY kind.
PLY_KINDS = {
    "char": 1,
    "uchar": 1,
    "int8": 1,
    "uint8": 1,
    "short": 2,
    "ushort": 2,
    "int16": 2,
    "uint16": 2,
    "float16": 2,
}
PLY_KINDS |= {"int": 4, "uint": 4, "int32": 4, "uint32": 4, "float": 4, "float32": 4}
PLY_KINDS |= {"double": 8, "float64": 8, "int64": 8, "uint64": 8}
BETWEEN_SOLIDS = re.compile(rb"^[ \t]*endsolid[^\r\n]*[\r\n\s]+solid[^\r\n]*$", re.IGNORECASE | re.MULTILINE)


def check_headers(data: bytes, extension: str, limit: Limit) -> None:
    """Refuse a file whose header claims the impossible.

    Raises:
        SceneError: gives the reason.
    """
    if extension == "ply":
        _check_ply(data)
    elif extension == "off":
        _check_off(data)
    elif extension in ARCHIVES:
        _check_archive(data, limit)
    elif extension in XML:
        _check_xml(data, f"the {extension.upper()}")


def one_solid(data: bytes) -> bytes:
    """Join the solids of an ASCII STL: trimesh makes a mesh of each, which is slow for very many."""
    if data[:200].lstrip()[:5].lower() != b"solid" or b"\0" in data[:200]:
        return data
    return BETWEEN_SOLIDS.sub(b"", data)


def _check_ply(data: bytes) -> None:
    """Refuse counts for which the file is too short, and kinds that do not exist."""
    head, mark, _ = data[:LONGEST_HEADER].partition(b"end_header")
    lines = [line.split() for line in head.decode("latin-1").splitlines() if line.strip()]
    if not mark or lines[0][0].lower() != "ply":
        raise SceneError("broken PLY: expected a header from 'ply' to 'end_header', got none; export it anew")
    if not head.isascii():
        raise SceneError("broken PLY: expected a header of plain letters, got other bytes in it; export it anew")
    text, least, count, row = False, 0, 0, 0  # bytes of the shortest body, rows per element, bytes per row
    missing = {"x", "y", "z"}
    for words in lines[1:]:
        if words[0] == "format":
            text = "ascii" in words
        elif words[0] == "element":
            least, row = least + count * row, 0
            count = _whole(words[2]) if len(words) == 3 else -1
            if count < 0:
                raise SceneError(f"broken PLY: expected 'element NAME COUNT', got {_line(words)}; export it anew")
        elif words[0] == "property":
            kinds = words[2:4] if words[1:2] == ["list"] else words[1:2]
            if len(words) != 2 * len(kinds) + 1 or any(kind not in PLY_KINDS for kind in kinds):
                raise SceneError(f"broken PLY: expected 'property KIND NAME', got {_line(words)}; export it anew")
            row += 1 if text else PLY_KINDS[kinds[0]]  # of a list, its length
            missing -= {words[-1]}
    if missing:
        names = ", ".join(sorted(missing))
        raise SceneError(f"broken PLY: expected the properties x, y and z, got no {names}; export it anew")
    least, left = least + count * row, len(data) - len(head)
    if least > left:
        raise SceneError(f"broken PLY: its header promises {least} bytes or more, {left} follow; export it anew")


def _line(words: list[str]) -> str:
    return f"'{shorten(' '.join(words))}'"


def _check_off(data: bytes) -> None:
    """Refuse counts for which the file is too short."""
    words = (line.split(b"#")[0].split() for line in data[:LONGEST_HEADER].splitlines())
    numbers = [word for line in words for word in line if word.lstrip(b"-").isdigit()]
    counts = [_whole(word.decode("latin-1")) for word in numbers[:2]]
    if len(counts) < 2 or min(counts) < 0:
        raise SceneError("broken OFF: expected the numbers of vertices and faces, got none; export it anew")
    if 2 * sum(counts) > len(data):  # a row takes at least two bytes
        promised = f"{counted(counts[0], 'vertex', 'vertices')} and {counted(counts[1], 'face')}"
        raise SceneError(
            f"broken OFF: its header promises {promised}, the file has {counted(len(data), 'byte')}; export it anew"
        )


def _whole(word: str) -> int:
    """Parse a whole number of at least 0; -1 for anything else."""
    return int(word) if word.isdecimal() and word.isascii() and len(word) < 19 else -1


def _check_archive(data: bytes, limit: Limit) -> None:
    """Count the bytes that would be unpacked, and refuse XML that defines entities."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        limit.take("unpacked files", sum(info.file_size for info in archive.infolist()))
        for info in archive.infolist():
            for start in _starts(archive, info):
                _check_xml(start, f"{shorten(info.filename)} in it")


def _starts(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> Iterator[bytes]:
    """Yield the beginning of a file in an archive, where entities are defined."""
    if info.is_dir() or info.flag_bits & 1:
        return
    with archive.open(info) as file:
        yield file.read(LONGEST_HEADER)


def _check_xml(data: bytes, name: str) -> None:
    """Refuse XML that defines entities: they can read other files, or grow without end. No exporter writes any."""
    plain = data.replace(b"\0", b"")  # UTF-16 and UTF-32 as well
    if b"<!ENTITY" in plain or (b"<!DOCTYPE" in plain and (b"[" in plain.partition(b"<!DOCTYPE")[2][:1000])):
        raise SceneError(f"{name} defines XML entities, which are refused; export it anew")
