"""The files of the page: HTML, CSS and JavaScript, which are part of the package."""

import re
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

TYPE_LINES = re.compile(rb"^ */\*\*(?:[^*]|\*(?!/))*\*/\r?\n", re.MULTILINE)  # JSDoc comments with lines of their own


def page_files() -> dict[str, bytes]:
    """Read all files: name -> content; JavaScript without its types, which only `deno check` reads."""
    found = {}
    for entry in files(__package__).iterdir():
        suffix = PurePosixPath(entry.name).suffix
        if suffix in TYPES:
            data = entry.read_bytes()
            found[entry.name] = TYPE_LINES.sub(b"", data) if suffix == ".js" else data
    return found


def content_type(name: str) -> str:
    """Return the media type of a file."""
    return TYPES[PurePosixPath(name).suffix]
