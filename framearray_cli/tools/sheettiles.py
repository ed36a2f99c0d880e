"""The images of a contact sheet: which they are, which are there, and their pixels, shrunk."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from framearray_cli.array.images import area_mean
from framearray_cli.array.integrity import REMEDY, list_present
from framearray_cli.array.manifest import Manifest
from framearray_cli.array.pictures import AS_RENDERED, Pictures, Relight
from framearray_cli.array.places import MIDDLE_PLACE, brief_frames_text, read_indices
from framearray_cli.base.arrays import Float32
from framearray_cli.base.errors import JobError, OutputError
from framearray_cli.base.forms.words import shown
from framearray_cli.base.units import agree, counted

from .axes import LightIndices, evenly_spaced, given_places
from .progress import Progress


class SheetPlaces(NamedTuple):
    """The images of a sheet: cameras by column, lights along the axis number `side` by row, fixed along the others."""

    cameras: Sequence[int]
    lights: Sequence[int]
    side: int
    fixed: LightIndices

    def at(self, l: int) -> LightIndices:
        """Return the index along each axis for a row."""
        return (*self.fixed[: self.side], l, *self.fixed[self.side + 1 :])


def read_lights(
    manifest: Manifest, axis: str, light: str | None, at: Sequence[str], rows: int
) -> tuple[tuple[int, ...], LightIndices]:
    """Read the rows of the sheet, and the index along each axis that is not shown; that along the shown one is void.

    Args:
        rows: at most, where neither `light` nor `at` names them.
    """
    if axis not in manifest.axes:
        raise JobError("--side", [f"expected one of the axes {', '.join(manifest.axes)}, got {shown(axis)}"])
    given = given_places(manifest, light, at)
    found = {
        name: read_indices(*given.get(name, (f"--at {name}", MIDDLE_PLACE)), n, name)
        for name, n in manifest.axes.items()
    }
    shown_rows = found[axis] if axis in given else evenly_spaced(manifest.axes[axis], rows)
    for name, places in found.items():
        if name != axis and len(places) > 1:
            raise JobError(given[name][0], [f"expected one place, as the rows are those of {axis}, got {len(places)}"])
    return shown_rows, tuple(places[0] for places in found.values())


def find_images(pictures: Pictures, places: SheetPlaces) -> tuple[NDArray[np.bool_], tuple[str, ...]]:
    """Return which images are there, (rows, columns), and warnings about the others.

    Raises:
        OutputError: none is there.
    """
    manifest, present = pictures.manifest, list_present(pictures.manifest)
    rows = [[present.has(pictures.files(c, places.at(l))) for c in places.cameras] for l in places.lights]
    there: NDArray[np.bool_] = np.array(rows)
    if there.all():
        return there, ()
    gone = int(np.count_nonzero(~there))
    lacking = [c for i, c in enumerate(places.cameras) if not there[:, i].all()]
    text = (
        f"{gone:,} of {counted(there.size, 'image')} of the sheet {agree(gone, 'is', 'are')} missing, "
        f"of {agree(len(lacking), 'camera', 'cameras')} {brief_frames_text(lacking)}; {REMEDY}"
    )
    if not there.any():
        raise OutputError(f"{manifest.directory}: {text}")
    return there, (text,)


def read_tiles(
    pictures: Pictures,
    places: SheetPlaces,
    there: NDArray[np.bool_],
    tile: tuple[int, int],
    progress: Progress | None,
    relight: Relight = AS_RENDERED,
) -> Float32:
    """Read the images that are there, and shrink them: (rows, columns, height, width, 3); the others are black."""
    total = int(np.count_nonzero(there))
    tiles = np.zeros((*there.shape, tile[1], tile[0], 3), np.float32)
    for done, (i, j) in enumerate(np.argwhere(there.T).tolist(), start=1):
        picture = pictures.picture(places.cameras[i], places.at(places.lights[j]), relight)
        tiles[j, i] = area_mean(picture, *tile)
        if progress:
            progress(done, total)
    return tiles
