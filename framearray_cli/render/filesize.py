"""Size of the files of an array, and space for them on the disk.

The size follows from crops of the images that are rendered with as many hits.

A smaller image of the same view compresses worse: its pixels differ more. So the crops have the pixels of the job's
images, and cover one image of the job's size.
"""

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from framearray_cli.array.folder import free_space
from framearray_cli.array.images import write_layers
from framearray_cli.base.errors import OutputError
from framearray_cli.base.units import size
from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.engine.images.compose import Composed
from framearray_cli.engine.images.dwa import LINES
from framearray_cli.engine.images.standard_error import standard_error
from framearray_cli.engine.inputs.cameras import ACROSS, DOWN, KIND, LEFT, OF_PANORAMA, TOP, Cameras, resized
from framearray_cli.engine.terms.ambient.intensity import Ambient
from framearray_cli.job.job import Job

from .frames import compose_frames
from .prepare import Prepared
from .rows import write_stored
from .trial import with_few_lights
from .writer import array_target, layer_attributes, layer_channels

SIDE = 96  # pixels of a crop
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
    crops, target = _compose(few, _cropped(setup), ambient), array_target(prepared)
    tiles = [(crop, p) for crop in crops for p in range(len(crop.images))]
    size = target.resolution
    image = _mosaic([crop.images[p] for crop, p in tiles], *size)
    alpha = None if crops[0].alpha is None else _mosaic([crop.alpha for crop, _ in tiles], *size)
    more = {}
    if crops[0].differences is not None:
        more = {
            "error": _mosaic([_error(crop, p) for crop, p in tiles], *size),
            "difference": _mosaic([crop.differences[p] for crop, p in tiles if crop.differences is not None], *size),
        }
    channels = [layer_channels(crop.layers) for crop in crops]
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        file, layers = Path(name, target.names.images[0].file(0)), Path(name, "layers")
        write_stored(file, image, target.format, target.attributes(0, 0), more, alpha)
        found = float(file.stat().st_size * n_images)
        if channels[0]:
            height, width = image.shape[:2]
            joined = {key: np.concatenate([channel[key] for channel in channels]) for key in channels[0]}
            write_layers(layers, joined, {**target.attributes(0), **layer_attributes(crops[0].layers)})
            found += layers.stat().st_size * height * width / next(iter(joined.values())).size
    return found


def _error(crop: Composed, p: int) -> Any:
    """Return the standard error of an image."""
    assert crop.differences is not None
    return standard_error(crop.differences[p], crop.hits.reshape(crop.images.shape[1:3]))


def _compose(prepared: Prepared, small: FrameSetup, ambient: Ambient) -> list[Composed]:
    """Compose all frames."""
    halves = array_target(prepared).format.composes_halves
    shape = (prepared.n_lights, small.cams.height, small.cams.width, 3)
    with TracePool(small, prepared.threads) as pool:
        frames = compose_frames(
            prepared, small, ambient, pool, range(small.n_frames),
            lambda: np.empty(shape, np.float16) if halves else np.empty(shape, np.float32),
        )  # fmt: skip
        return [composed for composed, _ in frames]


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
