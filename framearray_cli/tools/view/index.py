"""Tables of an array for the page: `index.json` and `contents.json`.

`index.json` has what does not change while an array is rendered, `contents.json` what is on disk now:

    live      true if the answer may change: from the server, not in an export
    index     digest of the index that the tiles are made by; if it differs, load the page again
    stamp     digest of all below
    images    number of images on disk, and in the array; layers do not count
    lacking   number of cameras that lack images, and their ranges as text
    streams   by key: "stamps", one text per camera that changes with its sources, "" if it has none; "missing",
              by camera, if it has some of its sources: first and last light position of each gap
"""

import json
import math
import os
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from itertools import groupby
from typing import Any

import numpy as np

from framearray_cli.array.images import FOR_SCREENS, format_name
from framearray_cli.array.manifest import Manifest, axis_moments, file_name, sun_angles
from framearray_cli.array.places import brief_frames_text
from framearray_cli.base.arrays import Float32, is_number
from framearray_cli.base.files import line_digest
from framearray_cli.base.lens import PANORAMA
from framearray_cli.base.sundays import moment_text

from .coding import Source, source_of, stamp_of
from .streams import Stream

CONTENTS_FILE = "contents.json"
INDEX_FORMAT = 3  # of the index and the tiles; a new number discards those that exist
SMALL_PIXELS = 100 * 75  # of a small picture, about: a quarter of 400 x 300 per side
SHEET_PIXELS = 1 << 21  # of a sheet at most: 8 MiB when decoded


def scan_sources(manifest: Manifest, streams: Sequence[Stream]) -> dict[str, Source]:
    """Return all files in the folders of an array, by name relative to the array's folder."""
    found: dict[str, Source] = {}
    for folder in {file_name(stream.files, 0).rpartition("/")[0] for stream in streams}:
        with suppress(OSError), os.scandir(manifest.directory / folder) as entries:
            for entry in entries:
                if source := source_of(entry):
                    found[f"{folder}/{entry.name}" if folder else entry.name] = source
    return found


def contents_table(manifest: Manifest, streams: Sequence[Stream], index: str, *, live: bool) -> dict[str, Any]:
    """Return the content of `contents.json`."""
    sources = scan_sources(manifest, streams)
    table: dict[str, Any] = {}
    lacking: set[int] = set()
    images = [0, 0]
    for stream in streams:
        stamps, missing = [], {}
        for c in range(manifest.n_cameras):
            found = [sources.get(file_name(stream.files, c, l)) for l in range(stream.n)]
            stamps.append(stamp_of("", found)[:8])
            if stream.role != "layer":
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


@dataclass(frozen=True, slots=True, kw_only=True)
class SheetLayout:
    """A grid of small pictures.

    Attributes:
        factor: pixels of a full picture per pixel of a small one, along each side.
        width, height: of a small picture, pixels.
        columns: small pictures per row.
    """

    factor: int
    width: int
    height: int
    columns: int

    def sheet(self, n: int) -> tuple[int, int]:
        """Return height and width of a sheet of n small pictures."""
        columns = min(n, self.columns)
        return -(-n // columns) * self.height, columns * self.width

    def part(self, l: int) -> tuple[slice, slice]:
        """Return rows and columns of the small picture of light l."""
        row, column = divmod(l, self.columns)
        top, left = row * self.height, column * self.width
        return slice(top, top + self.height), slice(left, left + self.width)

    def reduce(self, values: Float32) -> Float32:
        """Average blocks of factor x factor pixels; those at the right and lower edge may be smaller."""
        for axis in (0, 1):
            starts = np.arange(0, values.shape[axis], self.factor)
            counts = np.diff(np.append(starts, values.shape[axis])).astype(np.float32)
            sums = np.add.reduceat(values, starts, axis=axis)
            values = np.asarray(sums / counts.reshape((-1, 1, 1) if axis == 0 else (1, -1, 1)), np.float32)
        return values


def sheet_layout(resolution: tuple[int, int], n: int) -> SheetLayout:
    """Choose the size of small pictures: about SMALL_PIXELS, or less so that n of them fit in a sheet."""
    width, height = resolution
    wanted = min(SMALL_PIXELS, max(1, SHEET_PIXELS // n))
    factor = max(1, round(math.sqrt(width * height / wanted)))
    small = -(-width // factor), -(-height // factor)
    columns = max(1, min(n, math.ceil(math.sqrt(n * small[1] / small[0]))))
    return SheetLayout(factor=factor, width=small[0], height=small[1], columns=columns)


def index_table(manifest: Manifest, streams: Sequence[Stream], layout: SheetLayout) -> dict[str, Any]:
    """Return the content of `index.json`; `digest` covers all other keys."""
    table = {
        "format": INDEX_FORMAT,
        "fingerprint": manifest.fingerprint,
        "name": manifest.name,
        "resolution": list(manifest.resolution),
        "fps": manifest.fps,
        "n_cameras": manifest.n_cameras,
        "axes": [_axis(manifest, name) for name in manifest.axes],
        "exposure": _exposure(manifest),
        "small": asdict(layout),
        "streams": [
            {key: getattr(stream, key) for key in ("key", "role", "label", "axis", "n", "exposed")}
            | asdict(stream.coding)
            for stream in streams
        ],
        "panorama": manifest.cameras[0].type == PANORAMA,
        "has_exr": not manifest.groups and format_name(manifest.images) == "exr",
        "background_ambient": list(manifest.background_ambient),
        "ambient": {group.name: [list(light.ambient) for light in group.lights] for group in manifest.groups},
    }
    return {**table, "digest": line_digest(json.dumps(table).encode()).decode()}


def _axis(manifest: Manifest, name: str) -> dict[str, Any]:
    """Describe a light axis; under a sun with `times`, date and time of each position, and `sun`, where it stands."""
    found: dict[str, Any] = {"name": name, "n": manifest.axes[name]}
    if times := [moment_text(moment) for moment in axis_moments(manifest).get(name, ())]:
        suns = [sun_angles(manifest, name, l) for l in range(len(times))]
        found |= {"times": times} | ({"sun": suns} if all(suns) else {})
    return found


def _exposure(manifest: Manifest) -> float:
    """Return the job's exposure, stops; 0 if the images are PNG or JPEG, which contain it already."""
    output = manifest.job.get("output", {})
    linear = manifest.groups or format_name(manifest.images) not in FOR_SCREENS
    value = output.get("exposure", 0.0) if isinstance(output, dict) and linear else 0.0
    return float(value) if is_number(value) else 0.0
