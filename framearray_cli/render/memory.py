"""Memory that a job needs, and its blocks of light positions."""

from bisect import bisect_left

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.base.errors import JobError
from framearray_cli.base.memory import free_memory, resident_memory
from framearray_cli.base.units import gibibytes, in_unit_of
from framearray_cli.engine.frames.passes import frame_hits
from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.engine.hits.emission import EMISSION_COLUMNS
from framearray_cli.engine.hits.gloss import gloss_columns
from framearray_cli.engine.hits.hits import empty_hits
from framearray_cli.engine.hits.native import flag_mirrors
from framearray_cli.engine.hits.rays import room_for_hits
from framearray_cli.engine.images.marks import KINDS, RANKS
from framearray_cli.engine.inputs.gloss import DIELECTRIC, WIDE
from framearray_cli.engine.inputs.marks import mark_columns
from framearray_cli.engine.kernels.simd import LANES
from framearray_cli.engine.terms.ambient.estimate import BATCH
from framearray_cli.engine.terms.cells.gather import LIGHT
from framearray_cli.engine.terms.cells.lookups import MOST_NEAR
from framearray_cli.engine.terms.lobes import CERTAIN
from framearray_cli.engine.terms.obscurance import HITS_TOGETHER
from framearray_cli.scene.scene import Scene

from .cell_memory import builds_cells, cells_memory, expected_build, expected_light, expected_table
from .prepare import Prepared
from .writer import BLOCKS, image_format

# Share of the free memory for frames in progress unless the job sets a limit; the rest is for scene, files and others.
FREE_SHARE = 2 / 3
# Memory still to be allocated when a job is planned: kernels, and the arrays of each thread; measured at 1920 x 1080.
GROWTH = 256 * 2**20
# Of the tree that finds what rays meet.
TREE_PER_TRIANGLE = 100
# Number of frames searched for mirrors, and rays per batch.
PILOT_FRAMES, PILOT_BATCH = 8, 2048
LAYER_CHANNELS = 14
# What a dielectric reflects beyond that face on, mean over directions.
GRAZING_SHARE = 0.05


def program_memory() -> int:
    """Return the bytes that the program needs besides frames: those it holds now, and those it will still load."""
    return resident_memory() + GROWTH


def memory_limit(prepared: Prepared, setup: FrameSetup | None = None) -> int:
    """Return the bytes that frames in progress may take: the rest of the job's limit, or a share of the free memory.

    Args:
        setup: whose cells stay beside the frames, for all light positions; it may have a few of them only. None: a job
            without cells.
    """
    most = _most_memory(prepared, setup)
    return most if prepared.job.render.memory else min(int(FREE_SHARE * (most + GROWTH)), most)


def _most_memory(prepared: Prepared, setup: FrameSetup | None = None) -> int:
    """Return the bytes beyond which frames in progress do not fit at all; see `memory_limit`."""
    limit, there, table = prepared.job.render.memory, 0, 0
    if setup is not None and setup.cells is not None:
        there, table = setup.cells.light.nbytes, cells_memory(setup, prepared.n_lights)
    if limit and builds_cells(prepared):  # the same before and after the build, with kernels loaded or not
        return limit - prepared.held - GROWTH - TREE_PER_TRIANGLE * len(prepared.scene.corners) - table
    return limit - program_memory() if limit else free_memory() + there - table - GROWTH


def require_memory(prepared: Prepared, per_pixel: Float64 | None = None, setup: FrameSetup | None = None) -> None:
    """Refuse a job that does not fit into memory even light by light; the system would kill it without a message.

    Args:
        per_pixel: see `window_memory`.
        setup: see `memory_limit`; None: cells, if any, are still to be built.

    Raises:
        JobError: it does not fit.
    """
    window = window_memory(prepared, 1, per_pixel=per_pixel)
    if setup is not None and builds_cells(prepared):
        _require(prepared, window, _copied(setup, prepared.n_lights, 1), _most_memory(prepared, setup))
        return
    copied = expected_light(prepared, 1) if prepared.n_lights > 1 else 0
    cells = max(expected_table(prepared) + copied, expected_build(prepared) - window)
    walks = 0 if prepared.job.render.memory else ambient_memory(prepared)
    _require(prepared, max(window, walks), cells, _most_memory(prepared))


def _require(prepared: Prepared, window: int, cells: int, limit: int) -> None:
    """Refuse a job whose frames and cells do not fit into what they may take; see `require_memory`."""
    if window + cells <= limit:
        return
    job, typed = prepared.job, prepared.job.render.memory
    keys = "a smaller camera.resolution, reuse.n_r or samples.hits"
    if job.samples.error is not None:
        keys = "a larger samples.error, or a smaller camera.resolution, reuse.n_r or samples.most_hits"
    # report memory of the whole program, where the job's limit is given
    more = typed - limit if typed else GROWTH
    least, most, part = (
        in_unit_of(n, typed) if typed else gibibytes(n) for n in (window + cells + more, limit + more, cells)
    )
    if cells > window:
        keys = f"cells take {part} of it, and a smaller indirect.samples"
    problem = f"rendering needs at least {least} of memory, {most} may be used; {keys} takes less"
    raise JobError(job.file or job.name, [problem])


def ambient_memory(prepared: Prepared) -> int:
    """Return the bytes of all batches of walks: radiance per walk and light, in float32 and twice in float64."""
    n_lights = prepared.n_lights if prepared.job.indirect.method == "obscurance" else 1  # see `prepare._ambient`
    return prepared.threads * BATCH * n_lights * 3 * (4 + 8 + 8)


def window_memory(
    prepared: Prepared, n_lights: int, mirror_share: float = 0.0, per_pixel: Float64 | None = None
) -> int:
    """Return the bytes of the window of frames and of the images in progress, for some of the lights.

    A hit takes its irradiance under every light, one row, and its place and weight in every frame that uses it.

    Args:
        mirror_share: share of pixels that see a mirror; their hits are held until their frame is composed.
        per_pixel: (n_frames,) mean native hits per pixel of every frame; None: as `samples.hits` says.
    """
    job = prepared.job
    n_frames, n_r = (1, 0) if prepared.still else (prepared.n_cameras, job.n_r)
    width, height = job.camera.resolution
    per_pixel = frame_hits(n_frames, job.n_r, job.hits) if per_pixel is None else per_pixel
    held = max(float(per_pixel[max(j - n_r, 0) : j + n_r + 1].sum()) for j in range(n_frames))
    frames = min(2 * n_r + 1, n_frames)
    weighed = 5 if job.reuse.weights == "area" else 4 if job.reuse.weights == "balance" and n_r > 0 else 0
    values = prepared.light_arrays.channels * n_lights
    per_record = 4 * (values + LANES + (LIGHT + values if job.indirect.method != "obscurance" else 0))
    per_record += 4 * EMISSION_COLUMNS * (prepared.light_arrays.emitters.span.size > 0)
    days, glass = job.sun_days if job.output.layers else (), prepared.scene.has_glass
    sources, channels = len(prepared.light_arrays.kind), prepared.light_arrays.channels
    glossy = prepared.scene.is_glossy
    per_record += 4 * glossy * gloss_columns(sources, channels, n_lights, glass=glass, mirrored=True)
    columns = mark_columns(**job.output.marks)
    per_record += 4 * columns
    per_hit = per_record + 16 * job.output.layers + 4 * len(days) + frames * (4 + weighed)
    per_hit += glass * (
        8 * frames * job.output.marks["mattes"] + 12 * frames + 4 * LANES
    )  # what passes it in each frame; the rows that one frame sees
    # a frame's mirror hits wait for N_r frames; twice while the lists of all batches are joined, and chains add some
    mirrored = mirror_share * job.specular.hits * (n_r + 3) * per_record
    mirrored += glass * float(per_pixel.max()) * (n_r + 3) * per_record  # one face of glass in every pixel
    if job.specular.depth and glossy:
        mirrored += followed_share(prepared.scene) * float(per_pixel.max()) * (n_r + 3) * per_record
    # of the frame being traced: the pixel of each hit in every frame of the window, before hits are sorted by it
    finding = float(per_pixel.max()) * frames * 4
    channels = LAYER_CHANNELS * job.output.layers + len(days) + bool(days) + bool(job.output.alpha)
    channels += 2 * (bool(columns) * 5 + 2 * RANKS * len(KINDS) * job.output.marks["mattes"])
    layers = 2 * channels * 4  # while summed, and while written
    differences = (BLOCKS + 1) * 12 * n_lights * job.samples.halves
    per_image_pixel = (
        finding
        + layers
        + differences
        + frames * frames * 4
        + BLOCKS * (6 if image_format(job).composes_halves else 12) * n_lights
    )
    pixels = width * height * (held * per_hit + mirrored + per_image_pixel)
    return int(pixels) + prepared.threads * _gathering_memory(prepared, n_lights)


def followed_share(scene: Scene) -> float:
    """Return the share of hits that rays of lobes follow, by the area of materials; at most twice what eyes may see."""
    corners = scene.corners.astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    certain = DIELECTRIC + scene.metallic * scene.reflectivity.mean(axis=1)
    narrow = (scene.roughness > 0) & (scene.roughness**2 < WIDE)
    chance = np.where(narrow, np.minimum((certain + GRAZING_SHARE) / CERTAIN, 1.0), 0.0)
    return min(2 * float((area * chance[scene.material]).sum() / area.sum()), 1.0)


def _gathering_memory(prepared: Prepared, n_lights: int) -> int:
    """Return the bytes per thread for light from cells that grow with the light positions; see `Scratch`."""
    job, values = prepared.job, prepared.light_arrays.channels * n_lights
    if job.indirect.method != "cells":
        return 0
    near = 2 * 2 * MOST_NEAR * values  # of rays too short for cells: irradiance, and what leaves
    smooth = HITS_TOGETHER * values if job.indirect.filter and not job.indirect.exact else 0
    paths = BATCH * (values + 3 * n_lights) if job.indirect.exact else 0
    return 4 * (near + smooth + paths)


def _copied(setup: FrameSetup | None, n_lights: int, size: int) -> int:
    """Return the bytes of cells that a block of light positions holds once more, unless it is the only one."""
    return cells_memory(setup, size) if setup and size < n_lights else 0


def light_blocks(
    prepared: Prepared,
    mirror_share: float,
    limit: int | None = None,
    per_pixel: Float64 | None = None,
    setup: FrameSetup | None = None,
) -> list[range]:
    """Split the light positions into as few blocks of about equal size as the memory limit allows.

    Every block renders the whole camera path and finds its hits again.

    Args:
        limit: bytes; None: `memory_limit`.
        per_pixel: see `window_memory`.
        setup: see `memory_limit`.

    Raises:
        JobError: beside the cells not even one light position fits.
    """
    n, most = prepared.n_lights, _most_memory(prepared, setup) if limit is None else limit
    limit = memory_limit(prepared, setup) if limit is None else limit

    def fits(count: int) -> bool:
        size = -(-n // count)
        return window_memory(prepared, size, mirror_share, per_pixel) + _copied(setup, n, size) <= limit

    if setup is not None and builds_cells(prepared):
        _require(prepared, window_memory(prepared, 1, mirror_share, per_pixel), _copied(setup, n, 1), most)
    count = min(1 + bisect_left(range(1, n + 1), True, key=fits), n)
    size = -(-n // count)
    return [range(first, min(first + size, n)) for first in range(0, n, size)]


def mirror_share(setup: FrameSetup) -> float:
    """Return the largest share of pixels that see a mirror, over some frames of the path; traces one ray per pixel."""
    if not setup.depth:
        return 0.0
    rays, hits, most = room_for_hits(PILOT_BATCH), empty_hits(PILOT_BATCH), 0
    for c in np.unique(np.linspace(0, setup.n_frames - 1, PILOT_FRAMES).astype(int)):
        flags = np.zeros(setup.n_pixels, np.uint8)
        for first in range(0, setup.n_pixels, PILOT_BATCH):
            n = min(PILOT_BATCH, setup.n_pixels - first)
            flag_mirrors(setup.cams, int(c), setup.order, first, n, setup.world, rays.packets, hits, flags)
        most = max(most, int(flags.sum()))
    return most / setup.n_pixels
