"""A frame array as a zarr store of version 3. The one module that imports zarr, which `FrameArray.to_zarr` loads."""

import os
import warnings
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import zarr

from framearray_cli import __version__
from framearray_cli.array.images import HALF_MAX
from framearray_cli.array.integrity import REMEDY, list_present
from framearray_cli.array.places import brief_frames_text
from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import whole_folder

from .stored import StoredArray
from .variables import RADIANCE, Variable, local_times, seconds, variables

DTYPES = ("float32", "float16")


def write_store(array: StoredArray, path: Path, dtype: str, *, overwrite: bool, threads: int) -> None:
    """Write all pictures into a store; see `FrameArray.to_zarr`."""
    if dtype not in DTYPES:
        raise ValueError(f"dtype: expected {' or '.join(DTYPES)}, got {dtype!r}")
    if threads < 1:
        raise ValueError(f"threads: expected at least 1, got {threads}")
    _require_free(path, overwrite=overwrite)
    if missing := list_present(array.manifest).incomplete():
        where = f"cameras {brief_frames_text(missing)}" if len(missing) > 1 else f"camera {missing[0]}"
        raise OutputError(f"{array.folder}: images of {where} are missing; {REMEDY}")
    with whole_folder(path.absolute(), replace=overwrite) as part:
        root = zarr.create_group(store=part, zarr_format=3, attributes=_attributes(array))
        pictures = _create(root, array, dtype)
        with ThreadPoolExecutor(threads, thread_name_prefix="zarr") as pool:
            try:
                places = product(*(range(n) for n in array.shape[:-3]))
                for _ in pool.map(lambda place: _write(array, pictures, place), places):
                    pass
            except BaseException:
                pool.shutdown(cancel_futures=True)
                raise
        with warnings.catch_warnings():  # that zarr's standard lacks it; xarray looks for it first
            warnings.simplefilter("ignore")
            zarr.consolidate_metadata(part)


def _require_free(path: Path, *, overwrite: bool) -> None:
    """Refuse a path where something is, before anything is read."""
    if os.path.isdir(path):
        if not overwrite and any(path.iterdir()):
            raise OutputError(f"{path}: is there already; give another path, or overwrite=True to replace it")
    elif os.path.lexists(path):
        raise OutputError(f"{path}: a file of that name is in the way of the store")


def _attributes(array: StoredArray) -> dict[str, Any]:
    return {
        "framearray": __version__,
        "array": array.name,
        "fps": array.fps,
        "fingerprint": array.manifest.fingerprint,
        "camera_space": "x right, y up, looks along -z; matrices act on column vectors",
        "lights": "as rendered, times the factors of relight; strengths and positions as in manifest.toml",
        "intrinsics": "of OpenCV's camera space; the first pixel's middle is (0.5, 0.5)",
    }


def _create(root: zarr.Group, array: StoredArray, dtype: str) -> "zarr.Array[Any]":
    """Write cameras, lights and indices, and create the array of pictures, in chunks of one each."""
    axes = tuple(array.axes)
    times = {name: Variable(one.dims, *seconds(one.values)) for name, one in local_times(array).items()}
    for name, one in (variables(array) | times).items():
        is_text = one.values.dtype.kind == "U"
        made = root.create_array(
            name, shape=one.values.shape, dtype="str" if is_text else one.values.dtype, dimension_names=one.dims,
            attributes=dict(one.notes),
        )  # fmt: skip
        made[...] = one.values
    return root.create_array(
        RADIANCE,
        shape=array.shape,
        chunks=(*(1,) * (len(array.shape) - 3), *array.shape[-3:]),
        dtype=dtype,
        dimension_names=("camera", *axes, "y", "x", "channel"),
        attributes={"channels": ["R", "G", "B"], "colour": "linear, Rec. 709 primaries"},
    )


def _write(array: StoredArray, pictures: "zarr.Array[Any]", place: tuple[int, ...]) -> None:
    """Write one picture."""
    c, *lights = place
    image = array.picture(c, dict(zip(array.axes, lights, strict=True)))
    if pictures.dtype == np.float16 and max(image.max(), -image.min()) > HALF_MAX:
        raise OutputError(
            f"{array.folder}: picture {list(place)} has values above {HALF_MAX:.0f}, the largest float16; write "
            'dtype="float32"'
        )
    pictures[place] = image
