"""Small frames that are discarded: they show what a job and its files cost, and have its kernels loaded or compiled.

The size of files follows from crops of the images that are rendered with as many hits. A smaller image of the same view
compresses worse: its pixels differ more. So the crops have the pixels of the job's images, and cover one image of the
job's size.
"""

import math
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from framearray_cli.array.folder import free_space
from framearray_cli.array.images import HALF_MAX, write_layers
from framearray_cli.base.arrays import Images
from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import digest
from framearray_cli.base.units import size
from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.engine.images.dwa import LINES, dwa_chunks
from framearray_cli.engine.inputs.cameras import ACROSS, DOWN, KIND, LEFT, OF_PANORAMA, TOP, Cameras, resized
from framearray_cli.engine.kernels.second_process import stop as stop_compiling_beside
from framearray_cli.engine.terms.ambient.intensity import Ambient
from framearray_cli.job.job import Job

from .frames import compose_all, compose_frames
from .pace import Cost, Pace, block_work, eye_work
from .plan import ambient_at
from .prepare import Prepared
from .rows import image_format, write_stored
from .writer import ArrayWriter, array_target, layer_channels, noise_of


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
    image: Images


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
                prepared, small, ambient, pool, range(n), writer.block,
                found=lambda c: pace.lap(hits=eye_work(small, c)),
            )  # fmt: skip
            for composed, images in frames:
                pace.lap(planes=len(planes))
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


def load_kernels(prepared: Prepared, setup: FrameSetup, ambient: Ambient) -> Images:
    """Load the kernels of all frames of a job, or compile them, before the first frame; return a small image of it."""
    few, setup, ambient = with_few_lights(prepared, setup, ambient, 1)
    small, kind = small_frames(setup, FEW_PIXELS), image_format(prepared.job)
    image: Images = compose_all(few, small, ambient, range(small.n_frames))[-1].images[0]
    stop_compiling_beside()
    if image.dtype == np.float16 and kind.compression in LINES:
        dwa_chunks(image, LINES[kind.compression])
    return image


def writing_cost(prepared: Prepared, image: Images) -> float:
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


SIDE = 96  # pixels of a crop for the size of files
CROPS, LIGHTS = 8, 4  # at most, crops each from another camera position, and about, light positions
HITS = 1_500_000  # in all crops, about
FIRST_FRAMES = 3  # a render that has no space for the files of so many camera positions is refused
FILE_HEAD = 2**16  # bytes of a file without its pixels, at most


def find_lacking_space(prepared: Prepared, setup: FrameSetup, ambient: Ambient, missing: float) -> list[str]:
    """Warn if the files to be rendered need more space than the disk has free.

    Args:
        setup: for all light positions.
        missing: number of camera positions to render; a part of one for some of its images.

    Raises:
        OutputError: not even the files of the first camera positions fit.
    """
    job, free = prepared.job, free_space(prepared.job.output.directory)
    if not 0 < free < missing * _most_bytes(prepared):  # file systems that do not know it say 0
        return []
    try:
        each = frame_bytes(prepared, setup, ambient, prepared.n_lights)
    except (OSError, OutputError):  # the folder of temporary files may be full, too
        return []
    text = lacking_space(job, int(missing * each), free)
    if text and min(missing, FIRST_FRAMES) * each > free:
        raise OutputError(f"{job.output.directory}: {text}")
    return [text] if text else []


def lacking_space(job: Job, needed: int, free: int) -> str:
    """Word that files need more bytes than the disk has free, and the remedy; empty if they fit."""
    if needed <= free:
        return ""
    table, lossless = job.output, job.samples.halves or job.output.alpha
    remedy = "a smaller camera.resolution needs less"
    if table.format == "tif":
        remedy = 'output.format = "exr" needs less'
    elif table.format == "exr" and table.half == "never":
        remedy = 'output.half = "auto" needs less'
    elif table.format == "exr" and table.compression not in LINES and not lossless:
        remedy = 'output.compression = "dwaa" needs less'
    return f"the images need about {size(needed)}, the disk has {size(free)} free; {remedy}"


def _most_bytes(prepared: Prepared) -> int:
    """Return the bytes of the files of a camera position if nothing is compressed; no trial is needed for them."""
    job, (width, height) = prepared.job, prepared.job.camera.resolution
    channels = 3 + bool(job.output.alpha) + 6 * job.samples.halves
    images = prepared.n_lights * (4 * channels * width * height + FILE_HEAD)
    return images + width * height * sum(feature.layer_bytes for feature in prepared.features) + FILE_HEAD


def frame_bytes(prepared: Prepared, setup: FrameSetup, ambient: Ambient, n_images: int) -> float:
    """Return the bytes of the files of a camera position, with that many images.

    Args:
        setup: for all light positions of `prepared`.
    """
    few, setup, ambient = with_few_lights(prepared, setup, ambient, LIGHTS)
    small, target = _cropped(setup), array_target(prepared)
    crops = compose_all(few, small, ambient, range(small.n_frames))
    tiles = [(crop, p) for crop in crops for p in range(len(crop.images))]
    size = target.resolution
    image = _mosaic([crop.images[p] for crop, p in tiles], *size)
    alpha = None if crops[0].alpha is None else _mosaic([crop.alpha for crop, _ in tiles], *size)
    noise = [noise_of(crop, p) for crop, p in tiles]
    more = {name: _mosaic([tile[name] for tile in noise], *size) for name in noise[0]}
    channels = [layer_channels(crop.layers) for crop in crops]
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        file, layers = Path(name, target.names.images[0].file(0)), Path(name, "layers")
        write_stored(file, image, target.format, target.attributes(0, 0), more, alpha)
        found = float(file.stat().st_size * n_images)
        if channels[0]:
            height, width = image.shape[:2]
            joined = {key: np.concatenate([channel[key] for channel in channels]) for key in channels[0]}
            write_layers(layers, joined, target.attributes_of_layers(0, crops[0].layers))
            found += layers.stat().st_size * height * width / next(iter(joined.values())).size
    return found


def _cropped(setup: FrameSetup) -> FrameSetup:
    """Return crops, spread over the path and the picture, with as many native hits as frames have hits in all."""
    eyes = [setup.eyes_of(j) for j in range(setup.n_frames)]
    shown = np.array([sum(setup.per_pixel[setup.frame_of(eye)] for eye in window) for window in eyes])
    n = max(1, min(CROPS, setup.n_frames, int(HITS / (SIDE * SIDE * shown.mean()))))
    stride = setup.n_frames // n
    span = slice(stride // 2, stride // 2 + (n - 1) * stride + 1, stride)
    return replace(setup, cams=_crops(setup.cams.at(span)), per_pixel=shown[span], n_r=0, allotment=None)


def _crops(cams: Cameras) -> Cameras:
    """Return a crop of each eye's picture, each at another place; of panoramas small pictures."""
    width, height, n = min(SIDE, cams.width), min(SIDE, cams.height), len(cams.position)
    spread = (0.5 + np.outer(np.arange(n), (0.7549, 0.5698))) % 1  # evenly, in both directions
    left, top = np.floor(spread * (cams.width - width + 1, cams.height - height + 1)).T
    if len(cams.lens):
        if (cams.lens[:, KIND] == OF_PANORAMA).any():
            return resized(cams, 2 * height, height)
        lens = cams.lens.copy()
        lens[:, [ACROSS, DOWN]] *= cams.width / width, cams.height / height
        lens[:, LEFT] = (lens[:, LEFT] * cams.width - left) / width
        lens[:, TOP] = (lens[:, TOP] * cams.height - top) / height
        return cams._replace(width=width, height=height, lens=lens)
    across, down = left + (width - cams.width) / 2, top + (height - cams.height) / 2  # from the middle, pixels
    forward = _unit(cams.focal * cams.forward + across[:, None] * cams.right - down[:, None] * cams.up)
    right = _unit(cams.right - np.sum(cams.right * forward, axis=1, keepdims=True) * forward)
    up = np.cross(right, forward)
    forward, right, up = (np.ascontiguousarray(axis, np.float32) for axis in (forward, right, up))
    return cams._replace(width=width, height=height, forward=forward, right=right, up=up)


def _unit(vectors: Any) -> Any:
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def _mosaic(tiles: Sequence[Any], width: int, height: int) -> Any:
    """Fill an image with tiles, line by line and again from the first."""
    h, w = tiles[0].shape[:2]
    across, down = -(-width // w), -(-height // h)
    rows = [[tiles[(i * across + j) % len(tiles)] for j in range(across)] for i in range(down)]
    return np.ascontiguousarray(np.concatenate([np.concatenate(row, axis=1) for row in rows])[:height, :width])
