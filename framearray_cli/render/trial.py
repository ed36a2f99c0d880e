"""Render a few small frames that are discarded: they show what a job costs, and have its kernels loaded or compiled."""

import math
import tempfile
import time
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from framearray_cli.array.images import HALF_MAX
from framearray_cli.base.arrays import Image
from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import digest
from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.engine.images.dwa import LINES, dwa_chunks
from framearray_cli.engine.inputs.cameras import resized
from framearray_cli.engine.kernels.second_process import stop as stop_compiling_beside
from framearray_cli.engine.terms.ambient.intensity import Ambient

from .frames import compose_frames
from .pace import Cost, Pace, block_work, eye_work
from .plan import ambient_at
from .prepare import Prepared
from .rows import image_format, write_stored
from .writer import ArrayWriter, array_target


def few_prepared(prepared: Prepared, most: int) -> Prepared:
    """Return the same job with at most about `most` light positions; the job itself if it has no more."""
    planes = prepared.lights.few(most)
    if len(planes) == prepared.n_lights:
        return prepared
    return replace(prepared, lights=prepared.lights.at(planes), light_arrays=prepared.light_arrays.at(planes))


def with_few_lights(
    prepared: Prepared, setup: FrameSetup, ambient: Ambient, most: int
) -> tuple[Prepared, FrameSetup, Ambient]:
    """Return a planned job with at most about `most` light positions."""
    planes = prepared.lights.few(most)
    return few_prepared(prepared, most), setup.at(planes), ambient_at(ambient, planes)


def all_lights(prepared: Prepared, most: int, setup: FrameSetup, ambient: Ambient) -> tuple[FrameSetup, Ambient]:
    """Return the setup for all light positions, and their ambient light: each has the light of the nearest known one.

    Args:
        setup, ambient: for `few_prepared(prepared, most)`.
    """
    nearest = nearest_known(prepared, most)
    whole = replace(setup.at(nearest), lights=prepared.light_arrays, planes=prepared.lights.planes)
    return whole, ambient_at(ambient, nearest)


def nearest_known(prepared: Prepared, most: int) -> list[int]:
    """Return the nearest light position of `few_prepared(prepared, most)` for each of all."""
    planes = np.array(prepared.lights.few(most))
    found: list[int] = np.abs(np.arange(prepared.n_lights)[:, None] - planes).argmin(axis=1).tolist()
    return found


AnyImage: TypeAlias = Image | NDArray[np.float16]

# Pixels per frame that suffice to have all kernels loaded or compiled, and to show how well pictures compress.
FEW_PIXELS = 768
# Copies of a small picture in a large one differ in brightness by up to these shares, from copy to copy and from pixel
# to pixel, or they would compress better than pictures do.
BY_COPY, BY_PIXEL = 0.2, 0.03


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """Measured cost of a few small frames.

    Attributes:
        pixels: per frame.
        cost: per hit, plane and image of these frames.
        image: (height, width, 3) one of them.
    """

    pixels: int
    cost: Cost
    image: AnyImage


def run_trial(prepared: Prepared, setup: FrameSetup, ambient: Ambient, pixels: int) -> Trial:
    """Render and write frames of about that many pixels from the middle of the path.

    Args:
        setup: for all light positions of `prepared`.
    """
    small = small_frames(setup, pixels)
    n, still = small.n_frames, prepared.still
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name, TracePool(small, prepared.threads) as pool:
        pace = Pace(block_work(small, range(n), still=still), None)
        folder = Path(name)
        target = replace(array_target(prepared), directory=folder, resolution=(small.cams.width, small.cams.height))
        planes = range(prepared.n_lights)
        with ArrayWriter(target, planes, pool.threads, pace.written) as writer:
            frames = compose_frames(
                prepared, small, ambient, pool, range(n), writer.block, found=lambda c: pace.found(eye_work(small, c))
            )
            for composed, images in frames:
                pace.composed(len(planes))
                writer.write(composed, [composed.c], images)
            writer.finish()
        cost = pace.cost()
    assert cost is not None
    return Trial(pixels=small.n_pixels, cost=cost, image=composed.images[0].copy())


def n_small_frames(setup: FrameSetup) -> int:
    """Return the number of frames of `small_frames`."""
    return min(setup.n_r + 2, setup.n_frames)


def small_frames(setup: FrameSetup, pixels: int) -> FrameSetup:
    """Return a few frames from the middle of the path, with about that many pixels each."""
    n = n_small_frames(setup)
    first = (setup.n_frames - n) // 2
    cams, span = setup.cams, slice(first, first + n)
    shrink = min(math.sqrt(pixels / setup.n_pixels), 1.0)
    width, height = (max(1, round(side * shrink)) for side in (cams.width, cams.height))
    return replace(
        setup,
        cams=resized(cams.at(span), width, height),
        per_pixel=setup.per_pixel[span],
        allotment=None,  # of another resolution; `per_pixel` has its means
    )


def load_kernels(prepared: Prepared, setup: FrameSetup, ambient: Ambient) -> AnyImage:
    """Load the kernels of all frames of a job, or compile them, before the first frame; return a small image of it."""
    few, setup, ambient = with_few_lights(prepared, setup, ambient, 1)
    small, kind = small_frames(setup, FEW_PIXELS), image_format(prepared.job)
    shape = (few.n_lights, small.cams.height, small.cams.width, 3)
    images = np.empty(shape, np.float16 if kind.composes_halves else np.float32)
    with TracePool(small, prepared.threads) as pool:
        for _ in compose_frames(few, small, ambient, pool, range(small.n_frames), lambda: images):
            pass
    stop_compiling_beside()
    image: AnyImage = images[0]
    if kind.composes_halves and kind.compression in LINES:
        dwa_chunks(image, LINES[kind.compression])
    return image


def writing_cost(prepared: Prepared, image: AnyImage) -> float:
    """Return the processor seconds of writing an image, measured with one made of copies of a small one.

    Returns:
        0 if it cannot be written, on a full disk for instance.
    """
    target, random = array_target(prepared), np.random.default_rng(0)
    width, height = target.resolution
    h, w, _ = image.shape
    down, across = -(-height // h), -(-width // w)
    copies = np.tile(image.astype(np.float32), (down, across, 1)).reshape(down, h, across, w, 3)
    copies *= random.uniform(1 - BY_COPY, 1 + BY_COPY, (down, 1, across, 1, 1)).astype(np.float32)
    copies *= random.uniform(1 - BY_PIXEL, 1 + BY_PIXEL, copies.shape).astype(np.float32)
    np.minimum(copies, HALF_MAX, out=copies)
    large = np.ascontiguousarray(copies.reshape(down * h, across * w, 3)[:height, :width].astype(image.dtype))
    with suppress(OSError, OutputError), tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        path = Path(name) / target.names.images[0].file(0)
        seconds = []
        for _ in range(2):  # the first time takes longer: code is loaded, memory found
            started = time.thread_time()
            write_stored(path, large, target.format, target.attributes(0, 0), {}, None)
            digest(path)
            seconds.append(time.thread_time() - started)
        return min(seconds)
    return 0.0
