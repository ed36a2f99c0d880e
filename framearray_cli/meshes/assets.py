"""Files that a scene file refers to: buffers, material libraries, images; only from folders that it may use."""

import os
from dataclasses import dataclass, field
from pathlib import Path, PureWindowsPath
from urllib.parse import unquote

from ..errors import SceneError
from .limit import Limit
from .model import listed

LONGEST_NAME = 200  # characters of a file's name that a message repeats
REMEDY = "copy it beside the scene file, or name its folder in scene.folders of the job"


class AssetError(Exception):
    """A referenced file that is missing or may not be read; the message says which and why."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Assets:
    """What a scene may use: the folder of its file and all below, folders that the job adds, and memory.

    Attributes:
        refused: names of files that lie elsewhere, in the order in which they were asked for.
    """

    folder: Path
    folders: tuple[Path, ...] = ()
    limit: Limit = field(default_factory=Limit)
    refused: list[str] = field(default_factory=list)

    def read(self, name: str) -> bytes:
        """Return the bytes of a file named by the scene.

        Windows paths, percent codes, quotes and `file:` are understood. Where the named path does not exist, or leads
        elsewhere, a file of the same name directly in one of the folders is taken, as exporters often write paths of
        another machine. Links are followed, and must not lead elsewhere either.

        Raises:
            AssetError: missing, elsewhere, or unreadable.
            SceneError: larger than the memory that may be used.
        """
        told = shortened(name)
        clean = name.strip().strip('"')
        outside = is_url(clean)
        for spelling in () if outside else _spellings(clean):
            for root in (self.folder, *self.folders):
                whole = Path(os.path.abspath(root / spelling))
                if not any(_below(whole, allowed) for allowed in self._roots(lexical=True)):
                    outside = True  # told by its name alone: nothing elsewhere is even looked at
                elif not any(_below(_real(whole), allowed) for allowed in self._roots(lexical=False)):
                    outside = True
                elif _is_file(whole):
                    return self._bytes(whole, told)
        if outside or _leads_away(clean):
            if told not in self.refused:
                self.refused.append(told)
            raise AssetError(f"{told}: refused, it lies outside the scene's folder; {REMEDY}")
        raise AssetError(f"{told}: no such file beside the scene")

    def require_inside(self) -> None:
        """Refuse a scene that asked for files elsewhere.

        Raises:
            SceneError: names them.
        """
        if self.refused:
            many = len(self.refused) > 1
            lie = "they lie" if many else "it lies"
            remedy = REMEDY if not many else REMEDY.replace("it ", "them ", 1).replace("its folder", "their folders")
            raise SceneError(f"refused to read {listed(self.refused)}: {lie} outside the scene's folder; {remedy}")

    def _bytes(self, file: Path, told: str) -> bytes:
        try:
            self.limit.take("files", file.stat().st_size)
            return file.read_bytes()
        except OSError as error:
            raise AssetError(f"{told}: {error.strerror or error}") from error

    def _roots(self, *, lexical: bool) -> list[Path]:
        roots = [Path(os.path.abspath(root)) for root in (self.folder, *self.folders)]
        return roots if lexical else [_real(root) for root in roots]


def is_url(name: str) -> bool:
    """Whether a name says where on a network a file is; `C:` is a drive."""
    scheme, colon, rest = name.partition(":")
    return bool(colon) and len(scheme) > 1 and rest.startswith("//") and scheme.lower() != "file" and scheme.isalnum()


def shortened(name: str) -> str:
    """A name as a message repeats it: on one line, and not too long."""
    plain = "".join(c if c.isprintable() else "?" for c in name.strip())
    return plain if len(plain) <= LONGEST_NAME else plain[:LONGEST_NAME] + "..."


def _spellings(name: str) -> list[str]:
    """Ways to read a file name, likeliest first."""
    found: list[str] = []
    for text in (name, unquote(name)):
        slashes = _without_scheme(text).replace("\\", "/")
        for spelling in (text, slashes, PureWindowsPath(slashes).name):
            if spelling and "\0" not in spelling and spelling not in found:
                found.append(spelling)
    return found


def _without_scheme(name: str) -> str:
    """`/a/b` of `file:///a/b`, and `//server/a` of `file://server/a`."""
    if name[:5].lower() != "file:":
        return name
    return name[7:] if name[5:8] == "///" else name[5:]


def _leads_away(name: str) -> bool:
    """Whether a name starts at a drive, a server or the root, on whatever system."""
    return any(bool(PureWindowsPath(_without_scheme(text)).anchor) for text in (name, unquote(name)))


def _below(path: Path, root: Path) -> bool:
    return path.is_relative_to(root) and path != root


def _real(path: Path) -> Path:
    """A path with its links followed; a loop of links leads nowhere."""
    try:
        return Path(os.path.realpath(path))
    except (OSError, ValueError):
        return path


def _is_file(path: Path) -> bool:
    """Whether a path is a plain file; pipes and devices, which may never end, are not."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False
