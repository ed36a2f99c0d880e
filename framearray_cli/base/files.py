"""Files and folders that appear whole or not at all, and checksums of their contents.

They are written next to their target, then renamed.
"""

import errno
import hashlib
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from typing import BinaryIO

from .errors import OutputError

LONGEST_PATH = 1000  # characters of a file name with its folders; systems take 1024, some 4096
MOST_HEADER = 2**16  # bytes of an image file before its pixels, at most
REMEDIES = {errno.EMFILE: "`ulimit -n 1024` lets this program open more"}


def absolute(path: Path, job_file: Path | None) -> Path:
    """Resolve a path against the folder of the job file, or the working directory.

    Links among its folders are followed, so that `..` means what it means to the file system. A link at the end stays:
    the textures of a scene lie next to the link, not next to its target.
    """
    whole = (Path(job_file).parent if job_file else Path.cwd()) / path
    if path.name in ("", ".."):
        return Path(os.path.realpath(whole))
    return Path(os.path.realpath(whole.parent)) / path.name


@contextmanager
def whole_file(target: Path) -> Iterator[Path]:
    """Yield a path to write to; on success rename it to `target`, on any failure remove it.

    The temporary file lies next to the target, so that the rename stays within one file system. Its name starts with a
    dot, ends in `.part` and differs for each call, so several threads and programs may write at once. Missing folders
    are made. An interrupt (Ctrl-C) counts as a failure.

    Raises:
        OutputError: the system refused to write; the message names `target` and the reason.
    """
    part = target.with_name(f".{target.name}.{os.urandom(4).hex()}.part")
    try:
        make_folder(target.parent)
        yield part
        os.replace(part, target)
    except BaseException as error:
        with suppress(OSError):
            part.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise OutputError(f"{target}: cannot be written: {reason(error)}") from error
        raise


@contextmanager
def whole_folder(target: Path, *, replace: bool) -> Iterator[Path]:
    """Yield a folder to write into; on success rename it to `target`, on any failure remove it.

    A folder that exists there stays until then, and comes back if the last step fails or is interrupted.

    Args:
        replace: replace a folder that holds files; else only an empty one.

    Raises:
        OutputError: the system refused to write; the message names `target` and the reason.
    """
    make_folder(target.parent)
    try:
        with temporary_folder(target.parent, f"{target.name}.") as part:
            yield part
            _swap(part, target, replace=replace)
    except OSError as error:
        raise OutputError(f"{target}: cannot be written: {reason(error)}") from error


@contextmanager
def temporary_folder(parent: Path, stem: str) -> Iterator[Path]:
    """Make a hidden folder, and remove it with its contents at the end of the block."""
    part = parent / f".{stem}{os.urandom(4).hex()}.part"
    try:
        part.mkdir()
        yield part
    finally:
        shutil.rmtree(part, ignore_errors=True)


def _swap(part: Path, target: Path, *, replace: bool) -> None:
    """Rename a finished folder to its target and remove the old one; on failure put the old one back."""
    aside = part.with_suffix(".old")
    try:
        if os.path.isdir(target):
            target.rename(aside)
            if not replace and any(aside.iterdir()):
                raise OSError(errno.ENOTEMPTY, os.strerror(errno.ENOTEMPTY))
        part.rename(target)
        shutil.rmtree(aside, ignore_errors=True)
    except BaseException:
        if os.path.isdir(part):  # not renamed
            with suppress(OSError):
                aside.rename(target)
        else:
            shutil.rmtree(aside, ignore_errors=True)
        raise


def make_folder(folder: Path) -> None:
    """Make a folder and all missing folders above it.

    Raises:
        OutputError: the system refused, or a file is in the way.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except FileExistsError as error:
        raise OutputError(f"{folder}: a file of that name is in the way of the folder") from error
    except OSError as error:
        raise OutputError(f"{folder}: cannot make the folder: {reason(error)}") from error


@contextmanager
def folder_for(folder: Path) -> Iterator[None]:
    """Make a folder and all missing folders above it for a block; if the block fails, remove those that it made.

    Raises:
        OutputError: as `make_folder`.
    """
    made = [place for place in (folder, *folder.parents) if not os.path.exists(place)]
    try:
        make_folder(folder)
        yield
    except BaseException:
        for place in made:
            with suppress(OSError):  # others may have put something there
                place.rmdir()
        raise


def write_bytes(target: Path, data: bytes | memoryview) -> None:
    """Write a file whole or not at all."""
    with whole_file(target) as part:
        part.write_bytes(data)


def require_file(path: Path, remedy: str = "") -> None:
    """Refuse a path that exists and is no file: reading a pipe may wait forever, and a device may have no end.

    Raises:
        OutputError: the path is a folder, a pipe or a device; the message ends with the remedy.
    """
    if os.path.exists(path) and not os.path.isfile(path):
        raise OutputError(f"{path}: expected a file, got a folder or a device{remedy}")


def require_new(path: Path, *, force: bool) -> None:
    """Refuse to write a file where something is; with `force` only where a folder or a device is.

    Raises:
        OutputError: something is in the way.
    """
    require_file(path, "; give another name with --output")
    if not force and os.path.lexists(path):
        raise OutputError(f"{path}: is there already; give another name with --output, or --force to replace it")


def read_at_most(source: Path | BinaryIO, most: int) -> bytes | None:
    """Read a whole file, by its name or from an open one; None if it holds more than `most` bytes.

    Raises:
        OSError: it cannot be read.
        ValueError: its name holds a NUL.
    """
    with source.open("rb") if isinstance(source, Path) else nullcontext(source) as file:
        data = file.read(most + 1)
    return data if len(data) <= most else None


def refusal(part: Path, n_bytes: int) -> str:
    """Find out why a library could not write a file, by writing as many bytes in its place; "" if that succeeds.

    Libraries report that writing failed, but seldom why: a full disk, a quota.

    Args:
        part: the file that the library left; it is overwritten.
        n_bytes: size of its pixels.
    """
    try:
        with part.open("wb") as file:
            file.write(bytes(n_bytes + MOST_HEADER))
    except OSError as error:
        return reason(error)
    return ""


def reason(error: Exception) -> str:
    """The system's message, without the path, which the caller's message starts with; and the remedy, if known."""
    message = getattr(error, "strerror", "") or str(error) or type(error).__name__
    number = getattr(error, "errno", None)
    return f"{message}; {REMEDIES[number]}" if number in REMEDIES else message


def fingerprint(*parts: bytes | memoryview) -> str:
    """Hash parts of a job and a scene: "sha256:" and 64 hexadecimal digits.

    Each part is hashed on its own first, so moving bytes from one part to the next changes the result.
    """
    total = hashlib.sha256()
    for part in parts:
        total.update(hashlib.sha256(part).digest())
    return f"sha256:{total.hexdigest()}"


def digest(path: Path) -> tuple[int, str]:
    """Size and checksum of a file: XXH3 of 128 bits, which detects damage and runs at the speed of memory.

    Raises:
        OSError: it cannot be read.
    """
    import xxhash

    with path.open("rb") as file:
        total = xxhash.xxh3_128()
        size = 0
        while block := file.read(1 << 22):
            total.update(block)
            size += len(block)
    return size, total.hexdigest()


def line_digest(line: bytes) -> bytes:
    """Digest a line of a record: XXH3 of 64 bits, 16 hexadecimal digits."""
    import xxhash

    return xxhash.xxh3_64_hexdigest(line).encode()
