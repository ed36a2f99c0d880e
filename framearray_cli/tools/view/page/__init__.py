"""The files of the page: HTML, CSS and JavaScript, which are part of the package."""

from importlib.resources import files
from pathlib import PurePosixPath

TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
    ".json": "application/json",
    ".bin": "application/octet-stream",
}


def page_files() -> dict[str, bytes]:
    """Read all files: name -> content."""
    entries = [entry for entry in files(__package__).iterdir() if PurePosixPath(entry.name).suffix in TYPES]
    return {entry.name: entry.read_bytes() for entry in entries}


def content_type(name: str) -> str:
    """Return the media type of a file."""
    return TYPES[PurePosixPath(name).suffix]
