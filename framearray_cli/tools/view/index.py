"""What the page needs to know of an array: `index.json`, and the layout of small pictures in a sheet."""

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from framearray_cli.array.images import FOR_SCREENS, format_name
from framearray_cli.array.manifest import Manifest
from framearray_cli.array.moments import axis_moments, moment_text
from framearray_cli.base.arrays import Float32, is_number
from framearray_cli.base.hashing import line_digest

from .streams import Stream, is_exposed
from .turning import STEP_DEG, Turning

INDEX_FORMAT = 2  # of the index and the tiles; a new number discards those that exist
SMALL_PIXELS = 100 * 75  # of a small picture, about: a quarter of 400 x 300 per side
SHEET_PIXELS = 1 << 21  # of a sheet at most: 8 MiB when decoded


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


def index_table(
    manifest: Manifest, streams: Sequence[Stream], layout: SheetLayout, turning: Turning | None = None
) -> dict[str, Any]:
    """Return the content of `index.json`; `digest` is that of all the rest."""
    table = _index(manifest, streams, layout)
    if turning is not None:
        table |= {"axes": [turning.axis], "environment": {"file": turning.file.name, "step": STEP_DEG}}
    return {**table, "digest": line_digest(json.dumps(table).encode()).decode()}


def _index(manifest: Manifest, streams: Sequence[Stream], layout: SheetLayout) -> dict[str, Any]:
    return {
        "format": INDEX_FORMAT,
        "fingerprint": manifest.fingerprint,
        "name": manifest.name,
        "resolution": list(manifest.resolution),
        "fps": manifest.fps,
        "n_cameras": manifest.n_cameras,
        "axes": [_axis(manifest, name) for name in manifest.axes],
        "exposure": _exposure(manifest),
        "small": asdict(layout),
        "streams": [_stream(stream) for stream in streams],
        "background_ambient": list(manifest.background_ambient),
        "ambient": {group.name: [list(light.ambient) for light in group.lights] for group in manifest.groups},
    }


def _axis(manifest: Manifest, name: str) -> dict[str, Any]:
    """Describe a light axis; `times` only under a sun: the date and time of each position."""
    times = [moment_text(moment) for moment in axis_moments(manifest).get(name, ())]
    return {"name": name, "n": manifest.axes[name]} | ({"times": times} if times else {})


def _exposure(manifest: Manifest) -> float:
    """Return the job's exposure, stops; 0 if the images are PNG or JPEG, which contain it already."""
    output = manifest.job.get("output", {})
    linear = manifest.groups or format_name(manifest.images) not in FOR_SCREENS
    value = output.get("exposure", 0.0) if isinstance(output, dict) and linear else 0.0
    return float(value) if is_number(value) else 0.0


def _stream(stream: Stream) -> dict[str, Any]:
    return {
        "key": stream.key,
        "role": stream.role,
        "label": stream.label,
        "axis": stream.axis,
        "n": stream.n,
        "exposed": is_exposed(stream),
        **asdict(stream.coding),
    }
