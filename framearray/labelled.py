"""A frame array as a lazy array of xarray, which reads files when values are needed.

The one module that imports xarray, which `FrameArray.to_xarray` loads.
"""

from typing import Any

import numpy as np
import xarray
from numpy.typing import NDArray
from xarray.backends import BackendArray
from xarray.core import indexing

from .stored import StoredArray
from .variables import RADIANCE, local_times, variables

CHANNELS = ("R", "G", "B")


def data_array(array: StoredArray, name: str) -> xarray.DataArray:
    """Return all pictures as one lazy array; see `FrameArray.to_xarray`."""
    dims = ("camera", *array.axes, "y", "x", "channel")
    coords: dict[str, Any] = {dim: np.arange(n) for dim, n in zip(dims[:-3], array.shape[:-3], strict=True)}
    coords["channel"] = list(CHANNELS)
    coords |= {label: (one.dims, one.values) for label, one in local_times(array).items()}
    stored = indexing.LazilyIndexedArray(StoredPictures(array))
    return xarray.DataArray(xarray.Variable(dims, stored, attributes(array)), coords=coords, name=name)


def labelled_set(array: StoredArray) -> xarray.Dataset:
    """Return all pictures, lazy, with cameras and lights; see `FrameArray.to_dataset`."""
    pictures = data_array(array, RADIANCE)
    found = {name: xarray.Variable(one.dims, one.values, one.notes) for name, one in variables(array).items()}
    others = {name: one for name, one in found.items() if name not in pictures.coords}
    return xarray.Dataset({RADIANCE: pictures, **others}, attrs=attributes(array))


def attributes(array: StoredArray) -> dict[str, Any]:
    """Return what is to be known of the values."""
    values = "radiance" if array.is_radiance else "light of 8-bit sRGB, clipped to [0, 1]"
    return {"long_name": values, "colour": "linear, Rec. 709 primaries", "array": array.name, "fps": array.fps}


class StoredPictures(BackendArray):
    """An array as a backend of xarray: indices determine which pictures are read."""

    def __init__(self, array: StoredArray) -> None:
        self._array = array
        self.shape, self.dtype = array.shape, np.dtype(np.float32)

    def __getitem__(self, key: indexing.ExplicitIndexer) -> Any:
        return indexing.explicit_indexing_adapter(key, self.shape, indexing.IndexingSupport.OUTER, self._read)

    def _read(self, key: tuple[Any, ...]) -> NDArray[np.float32]:
        """Read pictures at indices, slices or lists of indices along each axis; an index drops its axis."""
        *outer, y, x, channel = key
        grid = [np.arange(n)[part] for n, part in zip(self.shape[:-3], outer, strict=True)]
        if all(part.ndim == 0 for part in grid):
            return _cut(self._picture([int(part) for part in grid]), y, x, channel)
        lists = [np.atleast_1d(part) for part in grid]
        inner = [np.arange(n)[part].shape for n, part in zip(self.shape[-3:], (y, x, channel), strict=True)]
        found = np.empty((*(len(part) for part in lists), *(n for shape in inner for n in shape)), np.float32)
        for place in np.ndindex(*found.shape[: len(lists)]):
            picture = self._picture([int(part[k]) for part, k in zip(lists, place, strict=True)])
            found[place] = _cut(picture, y, x, channel)
        return found.reshape(*(n for part in grid for n in part.shape), *found.shape[len(lists) :])

    def _picture(self, place: list[int]) -> NDArray[np.float32]:
        c, *lights = place
        return self._array.picture(c, dict(zip(self._array.axes, lights, strict=True)))


def _cut(picture: NDArray[np.float32], y: Any, x: Any, channel: Any) -> NDArray[np.float32]:
    """Cut indices, slices or lists of them out of a picture, one axis after the other."""
    everything = slice(None)
    if (y, x, channel) == (everything,) * 3:
        return picture
    return np.asarray(picture[:, :, channel][:, x][y])
