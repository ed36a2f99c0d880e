"""Files that a scene file refers to: buffers, material libraries, images; only from the scene's own folder."""

from dataclasses import dataclass
from pathlib import Path, PureWindowsPath
from urllib.parse import unquote


class AssetError(Exception):
    """A referenced file that is missing or may not be read; the message says which and why."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Assets:
    """The folder of a scene file, and nothing outside it."""

    folder: Path

    def read(self, name: str) -> bytes:
        """Return the bytes of a file named by the scene.

        Windows paths, percent codes and quotes are understood. Where the named path does not exist, a file
        of the same name directly in the folder is taken, as exporters often write paths of another machine.

        Raises:
            AssetError: missing, outside the folder, or unreadable.
        """
        clean = name.strip().strip('"')
        if clean.split(":", 1)[0].lower() in {"http", "https", "ftp"}:
            raise AssetError(f"{name}: is not on this machine; only files beside the scene are read")
        root = self.folder.resolve()
        outside = False
        for candidate in _spellings(clean):
            path = (root / candidate).resolve()
            if not path.is_relative_to(root):
                outside = True
            elif path.is_file():
                try:
                    return path.read_bytes()
                except OSError as error:
                    raise AssetError(f"{name}: {error.strerror or error}") from error
        if outside:
            raise AssetError(f"{name}: refused, it lies outside the scene's folder; copy it beside the scene file")
        raise AssetError(f"{name}: no such file beside the scene")


def _spellings(name: str) -> list[str]:
    """Ways to read a file name, likeliest first."""
    found: list[str] = []
    for text in (name, unquote(name)):
        slashes = text.replace("\\", "/")
        for spelling in (text, slashes, PureWindowsPath(text).name):
            if spelling and spelling not in found:
                found.append(spelling)
    return found
