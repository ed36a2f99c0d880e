"""Files that a scene file names (buffers, material libraries, images), and the memory for reading a scene.

Files are read only from folders that the scene may use. Memory is counted before it is allocated: a small file can hold
a huge scene.
"""

import os
import shlex
from collections.abc import Container, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path, PureWindowsPath
from urllib.parse import unquote

from framearray_cli.base.errors import SceneError
from framearray_cli.base.memory import free_memory
from framearray_cli.base.units import amount

from .model import join_names


@dataclass(slots=True, kw_only=True)
class Limit:
    """The number of bytes that may be taken, and what they were taken for.

    Attributes:
        most: bytes; by default all free memory.
        taken: kind of data -> bytes.
    """

    most: int = field(default_factory=free_memory)
    taken: dict[str, int] = field(default_factory=dict)

    def take(self, kind: str, size: int) -> None:
        """Count bytes that are about to be taken.

        Raises:
            SceneError: there are fewer left.
        """
        self.taken[kind] = self.taken.get(kind, 0) + size
        if sum(self.taken.values()) > self.most:
            kinds = ", ".join(f"{kind} {amount(size)}" for kind, size in self.taken.items())
            raise SceneError(
                f"reading it takes {amount(sum(self.taken.values()))} of memory or more ({kinds}), {amount(self.most)} "
                "may be used; make the scene smaller, or allow more with render.memory"
            )

    @contextmanager
    def lend(self, kind: str, size: int) -> Iterator[None]:
        """Count bytes that are returned at the end."""
        self.take(kind, size)
        try:
            yield
        finally:
            self.taken[kind] -= size


LONGEST_NAME = 200  # characters of a file name that a message repeats
MOST_FOLDERS = 4  # that a message says how to allow


class AssetError(Exception):
    """A named file is missing or may not be read; the message says which and why."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Assets:
    """Resources of a scene: the folder of its file with everything below, folders that the job adds, and memory.

    Attributes:
        shining: names of the materials whose emission is read; other emission is left out.
        as_file: True if surfaces follow the file, with its normal maps and glass; else they are diffuse or mirrors.
        all_uvs: True if texture coordinates are read where no texture needs them, too.
        time: of the pose of what moves, seconds; None: the start of the file's range.
        refused: files that lie elsewhere, in the order in which the scene named them: name in the scene -> the folder
            that would allow it.
        renamed: files found under a name that differs in upper and lower case: name in the scene -> name on the disk.
    """

    folder: Path
    folders: tuple[Path, ...] = ()
    limit: Limit = field(default_factory=Limit)
    shining: Container[str] = ()
    as_file: bool = False
    all_uvs: bool = False
    time: float | None = None
    refused: dict[str, Path] = field(default_factory=dict)
    renamed: dict[str, str] = field(default_factory=dict)

    def read(self, name: str) -> bytes:
        """Return the bytes of a file that the scene names; see `locate`.

        Raises:
            AssetError: missing, elsewhere, or unreadable.
            SceneError: larger than the memory that may be used.
        """
        file = self.locate(name)
        try:
            self.limit.take("files", file.stat().st_size)
            return file.read_bytes()
        except OSError as error:
            raise AssetError(f"{shorten(name)}: {error.strerror or error}") from error

    def locate(self, name: str) -> Path:
        """Return the path of a file that the scene names.

        Accepts Windows paths, percent codes, quotes and `file:`. Exporters often write paths of another machine: where
        the named path does not exist, or leads elsewhere, a file of the same name directly in one of the folders is
        read instead; then one whose name, or whose folders' names, differ in upper and lower case only. Links are
        followed, and must not lead elsewhere either.

        Raises:
            AssetError: missing, or elsewhere.
        """
        shown = shorten(name)
        clean = name.strip().strip('"')
        outside, inside = list[str](), list[Path]()
        for spelling in () if is_url(clean) else _spellings(clean):
            for root in (self.folder, *self.folders):
                whole = Path(os.path.abspath(root / spelling))
                if not self.holds(whole):
                    outside.append(str(whole))
                elif os.path.isfile(whole):
                    return whole
                else:
                    inside.append(whole)
        for whole in inside:
            for root in self._roots():
                found = self._in_any_case(whole, root) if root in whole.parents else None
                if found is not None and os.path.isfile(found):
                    self.renamed[shown] = found.relative_to(root).as_posix()
                    return found
        if any(self.refuses(name, path) for path in outside):
            raise AssetError(f"{shown}: refused, it lies outside the scene's folder")
        raise AssetError(f"{shown}: no such file next to the scene")

    def holds(self, path: Path) -> bool:
        """True if a path lies below one of the folders, by its name and with its links followed."""
        whole = Path(os.path.abspath(self.folder / path))
        named = any(root in whole.parents for root in self._roots())  # else nothing there is touched
        return named and any(_real(root) in _real(whole).parents for root in self._roots())

    def refuses(self, name: str, path: str) -> bool:
        """True if a file that lies elsewhere exists; `require_inside` then refuses the scene.

        Exporters write paths of other machines. Servers and URLs are not tried: the scene lacks such files.
        """
        if path.startswith(("//", "\\\\")) or not os.path.isabs(path) or not os.path.lexists(path):
            return False
        self.refuse(name, path)
        return True

    def refuse(self, name: str, path: str) -> None:
        """Keep a file that lies elsewhere, for `require_inside`."""
        self.refused.setdefault(shorten(name), self._folder_of(path))

    def _folder_of(self, path: str) -> Path:
        """Return a folder to allow a file: below the nearest folder that holds both scene and file, but never a root.

        A scene `shots/a.usd` that names `../assets/tree/tree.usd` will need more of `assets`.
        """
        file, scene = Path(_real(Path(path))), Path(os.path.abspath(self.folder))
        shared = [folder for folder in scene.parents if folder in file.parents and folder != Path(folder.anchor)]
        below = file.relative_to(shared[0]).parts[:-1] if shared else ()
        return shared[0].joinpath(*below[:1]) if shared else file.parent

    def require_inside(self) -> None:
        """Refuse a scene that named files elsewhere.

        Raises:
            SceneError: lists them, and the options that allow them.
        """
        if self.refused:
            it, lie, file = ("it", "lies", "file") if len(self.refused) == 1 else ("they", "lie", "files")
            folders = list(dict.fromkeys(map(name_here, self.refused.values())))
            allow = " ".join(f"--folder {shlex.quote(folder)}" for folder in folders[:MOST_FOLDERS])
            raise SceneError(
                f"refused to read {join_names(list(self.refused))}: {it} {lie} outside the scene's folder; allow the "
                f"folder with {allow} (scene.folders in a job), or copy the {file} next to the scene file"
            )

    def _in_any_case(self, path: Path, root: Path) -> Path | None:
        """Return the path in a folder that differs from a path in upper and lower case only; None without one."""
        found = root
        for name in path.relative_to(root).parts:
            try:
                if not (found / name).exists():
                    name = min(other for other in os.listdir(found) if other.casefold() == name.casefold())
            except (OSError, ValueError):  # a file, an unreadable folder, or no such name in it
                return None
            found /= name
            if not self.holds(found):
                return None
        return found

    def renamed_notes(self) -> list[str]:
        """Notes on files whose names differ in upper and lower case; one, or none."""
        if not self.renamed:
            return []
        pairs = [f"{name} ({found} on the disk)" for name, found in self.renamed.items()]
        return [f"names of files differ in upper and lower case only: {join_names(pairs)}"]

    def _roots(self) -> list[Path]:
        return [Path(os.path.abspath(root)) for root in (self.folder, *self.folders)]


def name_here(folder: Path) -> str:
    """Return the name of a folder as one types it in the current folder: relative, if it is near."""
    try:
        near = os.path.relpath(folder)
    except ValueError:  # another drive
        return str(folder)
    return str(folder) if near.startswith(os.path.join("..", "..", "..")) else near


def is_url(name: str) -> bool:
    """True if a name is a URL on a network; `C:` is a drive."""
    scheme, colon, rest = name.partition(":")
    return bool(colon) and len(scheme) > 1 and rest.startswith("//") and scheme.lower() != "file" and scheme.isalnum()


def shorten(name: str) -> str:
    """A name as messages repeat it: on one line, and not too long."""
    plain = "".join(c if c.isprintable() else "?" for c in name.strip())
    return plain if len(plain) <= LONGEST_NAME else plain[:LONGEST_NAME] + "..."


def _spellings(name: str) -> list[str]:
    """The paths that a file name may stand for, the likeliest first."""
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


def _real(path: Path) -> Path:
    """Follow the links of a path; one whose links form a loop stays as it is."""
    try:
        return Path(os.path.realpath(path))
    except (OSError, ValueError):
        return path
