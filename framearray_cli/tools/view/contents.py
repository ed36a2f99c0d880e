"""What of an array is there, for the page: `contents.json`.

live      whether the answer may change: true from the server, false in an export
index     digest of the index that the tiles are made by; another one: load the page again
stamp     digest of all below
images    number of images that are there, and in the array; layers and sums of light positions do not count
lacking   number of cameras that lack images, and their ranges as text
streams   by key: "stamps", one text per camera that changes with its sources, "" where none is there; "missing",
by camera, for those of which some sources are there: first and last light position of each gap
views     only where the page offers some: see `shaders`
"""

import json
import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from itertools import groupby
from typing import Any

from framearray_cli.array.manifest import Manifest
from framearray_cli.array.places import brief_frames_text
from framearray_cli.base.hashing import line_digest

from .stamps import Source, source_of, stamp_of
from .streams import Stream, source_name

CONTENTS_FILE = "contents.json"


def scan_sources(manifest: Manifest, streams: Sequence[Stream]) -> dict[str, Source]:
    """Return all files in the folders of an array, by name relative to the array's folder."""
    found: dict[str, Source] = {}
    for folder in {source_name(manifest, stream, 0, 0).rpartition("/")[0] for stream in streams}:
        with suppress(OSError), os.scandir(manifest.directory / folder) as entries:
            for entry in entries:
                if source := source_of(entry):
                    found[f"{folder}/{entry.name}" if folder else entry.name] = source
    return found


def contents_table(
    n_cameras: int,
    streams: Sequence[Stream],
    sources_of: Callable[[Stream, int], Sequence[Source | None]],
    index: str,
    *,
    live: bool,
) -> dict[str, Any]:
    """Return the content of `contents.json`.

    Args:
        sources_of: a stream and a camera -> the source of each of its pictures.
        index: its digest.
    """
    table: dict[str, Any] = {}
    lacking: set[int] = set()
    images = [0, 0]
    for stream in streams:
        stamps, missing = [], {}
        for c in range(n_cameras):
            found = sources_of(stream, c)
            stamps.append(stamp_of("", found)[:8])
            if stream.role not in ("layer", "environment"):
                images = [images[0] + sum(map(bool, found)), images[1] + len(found)]
            if not all(found):
                lacking.add(c)
                if any(found):
                    missing[str(c)] = _gaps(found)
        table[stream.key] = {"stamps": stamps, "missing": missing}
    rest = {"images": images, "lacking": [len(lacking), brief_frames_text(lacking)], "streams": table}
    stamp = line_digest(json.dumps(rest).encode()).decode()
    return {"live": live, "index": index, "stamp": stamp, **rest}


def _gaps(found: Sequence[Source | None]) -> list[tuple[int, int]]:
    """Return first and last index of each run of sources that are not there."""
    gaps = []
    for is_gap, run in groupby(range(len(found)), key=lambda l: found[l] is None):
        if is_gap:
            indices = list(run)
            gaps.append((indices[0], indices[-1]))
    return gaps
