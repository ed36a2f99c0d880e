"""Contact sheets in memory, for notebooks."""

import base64
import html
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from framearray_cli.array.images import encode_png
from framearray_cli.array.pictures import Pictures
from framearray_cli.base.errors import FrameArrayError
from framearray_cli.base.units import counted
from framearray_cli.tools.contactsheet import SheetOptions, drawn_sheet, plan_sheet, read_tiles, write_drawn

from .arguments import arguments_named
from .stored import StoredArray

# Pixels of images that a notebook's sheet may read: a fraction of a second.
MOST_READ = 2**23
COLUMNS, ROWS, WIDTH = 6, 4, 900  # of a notebook's sheet, at most


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Sheet:
    """A picture of pictures; notebooks show it.

    Attributes:
        codes: (h, w, 3) 8-bit sRGB.
        cameras: c of each column.
        lights: index along the shown axis of each row.
        warnings: images that are missing.
    """

    codes: NDArray[np.uint8]
    cameras: tuple[int, ...]
    lights: tuple[int, ...]
    warnings: tuple[str, ...]

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a PNG or JPEG.

        Raises:
            OutputError: the name has another suffix, or the system refuses.
        """
        write_drawn(Path(path), self.codes)

    def __repr__(self) -> str:
        height, width, _ = self.codes.shape
        shape = f"{counted(len(self.cameras), 'column')}, {counted(len(self.lights), 'row')}"
        return f"<Sheet: {shape}, {width} x {height} pixels>"

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return np.array(self.codes, dtype, copy=copy)

    def _repr_png_(self) -> bytes:
        return bytes(encode_png(self.codes, {}))


@arguments_named()
def draw(array: StoredArray, options: SheetOptions) -> Sheet:
    """Draw a contact sheet; see `FrameArray.sheet`."""
    pictures = Pictures(array.manifest, mix=array.lighting.mix)
    sheet = plan_sheet(pictures, options, summed=array.lighting.mixture is not None)
    tiles = read_tiles(pictures, sheet, relight=array.lighting.relight)
    return Sheet(
        codes=drawn_sheet(sheet, tiles, options),
        cameras=sheet.cameras,
        lights=sheet.lights,
        warnings=sheet.warnings,
    )


def html_of(array: StoredArray) -> str:
    """Describe an array for a notebook: a line of text, and a small contact sheet of what is there."""
    text = html.escape(repr(array)[1:-1])
    width, height = array.resolution
    fits = max(MOST_READ // (width * height), 1)
    rows = min(ROWS, max(int(fits**0.5), 1))
    columns = min(COLUMNS, max(fits // rows, 1))
    try:
        sheet = draw(array, SheetOptions(columns=columns, rows=rows, width=WIDTH))
    except FrameArrayError as error:
        return f"<p>{text}</p><p>{html.escape(str(error))}</p>"
    data = base64.b64encode(sheet._repr_png_()).decode()
    notes = "".join(f"<p>{html.escape(warning)}</p>" for warning in sheet.warnings)
    return f'<p>{text}</p><img alt="contact sheet" src="data:image/png;base64,{data}">{notes}'
