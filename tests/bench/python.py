"""Measure the Python package: `python -m bench.python [ARRAY]`.

Prints the time to open 9,216 images as a lazy array, beside that of importing xarray; and the time to read one image,
beside that of OpenImageIO for the same file, format by format. With ARRAY it reads the images of that array.
"""

import argparse
import itertools
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

import framearray
from framearray_cli.array.images import Extension, ImageFormat, write_image
from framearray_cli.array.manifest import Manifest, ManifestCamera, ManifestLight, image_path, matrix_rows
from framearray_cli.array.manifest_toml import write_manifest
from framearray_cli.base.openimage import oiio

N_C, N_L, SIZE = 192, 48, (400, 300)
FORMATS: dict[str, ImageFormat] = {
    "EXR": ImageFormat(),
    "EXR, zip": ImageFormat(compression="zip"),
    "EXR, dwaa": ImageFormat(compression="dwaa"),
    "TIFF": ImageFormat(format="tif"),
    "PNG": ImageFormat(format="png"),
}
TURNS = 200
IMPORTS = ("framearray", "numpy", "xarray")
OPEN = """
import sys, time
import framearray, xarray
array = framearray.open({folder!r})  # what numpy and pandas load late is loaded
array.to_xarray()
t = time.perf_counter()
lazy = framearray.open({folder!r}).to_xarray()
print(time.perf_counter() - t, lazy.shape)
"""
FIRST = """
import time
t = time.perf_counter()
import framearray
lazy = framearray.open({folder!r}).to_xarray()
print(time.perf_counter() - t)
"""


def write_array(folder: Path, extension: Extension, image_format: ImageFormat, n: tuple[int, int]) -> Path:
    """Write an array whose files are links to one noisy image."""
    width, height = SIZE
    light = {"type": "point", "position": [0.0, 1.0, 0.0], "intensity": [1.0, 1.0, 1.0]}
    manifest = Manifest(
        version="0",
        name="noise",
        fingerprint="sha256:0",
        images=f"noise.c{{camera:04d}}.l{{light:03d}}.{extension}",
        resolution=SIZE,
        fps=24.0,
        cameras=(ManifestCamera(world_from_camera=matrix_rows(np.eye(4)), fov=60.0),) * n[0],
        lights=(ManifestLight(ambient=(0.1,) * 3, ambient_error=(0.0,) * 3, sources=(light,)),) * n[1],
        directory=folder,
    )
    write_manifest(folder, manifest)
    pixels = np.random.default_rng(1).random((height, width, 3), np.float32)
    first = image_path(manifest, 0, 0)
    write_image(first, pixels, image_format)
    for c, l in itertools.product(range(n[0]), range(n[1])):
        if c or l:
            os.link(first, image_path(manifest, c, l))
    return folder


def seconds_of(code: str) -> tuple[float, str]:
    """Run code in a process of its own; the first word that it prints is a number of seconds."""
    runs = [subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True) for _ in range(5)]
    found = sorted((float(run.stdout.split()[0]), run.stdout.strip()) for run in runs)
    return found[len(found) // 2]


def in_turns(calls: Mapping[str, Callable[[], Any]], turns: int = TURNS) -> dict[str, float]:
    """Return the median processor time of each call, ms, measured in turns.

    All of it is spent in this thread, and other programs disturb it less than the time that passes.
    """
    times: dict[str, list[float]] = {name: [] for name in calls}
    for turn in range(turns + 10):
        for name, call in calls.items():
            t = time.thread_time()
            call()
            if turn >= 10:  # the first ones load code
                times[name].append(time.thread_time() - t)
    return {name: 1e3 * statistics.median(each) for name, each in times.items()}


def read_by_openimageio(file: Path) -> Any:
    """Read a file as OpenImageIO does without any check, as floats."""
    source = oiio().ImageInput.open(str(file))
    pixels = source.read_image(oiio().FLOAT)
    source.close()
    return pixels


def compare(name: str, folder: Path) -> str:
    """Describe the time to read one image, beside OpenImageIO."""
    array = framearray.open(folder)
    lazy, file = array.to_xarray(), array.file(0, 0)
    place = (0,) * (lazy.ndim - 3)
    found = in_turns(
        {
            "OpenImageIO": lambda: read_by_openimageio(file),
            "picture": lambda: array.picture(0, 0),
            "to_xarray": lambda: lazy[place].values,
        }
    )
    own = found["OpenImageIO"]
    ratios = ", ".join(f"{key} {ms:.2f} ms ({ms / own:.2f}x)" for key, ms in found.items() if key != "OpenImageIO")
    return f"{name}: OpenImageIO {own:.2f} ms, {ratios}"


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m bench.python", description=__doc__)
    parser.add_argument("array", nargs="?", type=Path, help="an array to read, without groups")
    array = parser.parse_args().array
    if array is not None:
        print(compare(str(array), array))
        return
    for module in IMPORTS:
        code = f"import time; t = time.perf_counter(); import {module}; print(time.perf_counter() - t)"
        print(f"import {module}: {seconds_of(code)[0]:.3f} s")
    with tempfile.TemporaryDirectory() as name:
        folder = write_array(Path(name), "exr", ImageFormat(), (N_C, N_L))
        n = f"{N_C * N_L:,} images"
        print(f"{n} as a lazy array: {seconds_of(OPEN.format(folder=str(folder)))[0]:.3f} s")
        print(f"the same with all imports: {seconds_of(FIRST.format(folder=str(folder)))[0]:.3f} s")
    for label, image_format in FORMATS.items():
        with tempfile.TemporaryDirectory() as name:
            print(compare(label, write_array(Path(name), image_format.format, image_format, (2, 2))))


if __name__ == "__main__":
    main()
