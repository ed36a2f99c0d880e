"""Memory that a job needs, and its blocks of light positions.

The number of cells is known after they are built; before, it is estimated by the number of samples.
"""

from bisect import bisect_left
from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.base.errors import JobError
from framearray_cli.base.memory import free_memory, resident_memory
from framearray_cli.base.units import gibibytes, in_unit_of
from framearray_cli.engine.features.glass import UNDIMMED_BYTES
from framearray_cli.engine.frames.kept_light import HEAD_BYTES, block_bytes, direct_bytes
from framearray_cli.engine.frames.pool import LIGHT_ROOM
from framearray_cli.engine.frames.records import StoredLight, bytes_per_hit
from framearray_cli.engine.frames.setup import FrameSetup, columns_of, frame_columns, kept_columns
from framearray_cli.engine.images.dwa import CODED
from framearray_cli.engine.terms.ambient.intensity import BATCH
from framearray_cli.engine.terms.cells.ends import MOST_NEAR
from framearray_cli.engine.terms.cells.solution import LIGHT_BLOCK
from framearray_cli.engine.terms.obscurance import HITS_TOGETHER

from .prepare import Prepared
from .rows import codes_rows, image_format, slices_of
from .writer import BLOCKS

# Share of the free memory for frames in progress unless the job sets a limit; the rest is for scene, files and others.
FREE_SHARE = 2 / 3
# Memory still to be allocated when a job is planned: kernels, and the arrays of each thread; measured at 1920 x 1080.
GROWTH = 256 * 2**20
# Of the tree that finds what rays meet.
TREE_PER_TRIANGLE = 100
LISTED = 4  # bytes of a hit in the list of a frame
# Bytes per pixel of a coded image, about the most of noise; of an image that is joined, and encoded; frames that wait.
MOST_CODED, JOINED, FRAMES_CODED = 3, 24, 2
# Cells per sample, about the most of all levels together, as a cell has four samples or more; cells per square root of
# the number of samples where the program chooses the edge; and per square of the edge on the surfaces of the scene.
MOST_PER_SAMPLE, PER_ROOT, PER_SQUARE = 0.2, 80.0, 2.0
# Bytes per cell of the table, without its light: guard, tint, other, and its slots.
BYTES_PER_CELL = 16 + 32 + 4 + 64
# Bytes per sample while samples are drawn and join their cells, and once they have.
DRAWN, PLACED = 190, 86 + 6 * (4 + 4) + 4
# Bytes per thread, of batches of walks and rays.
PER_THREAD = 6 * 2**20


def program_memory() -> int:
    """Return the bytes that the program needs besides frames: those it holds now, and those it will still load."""
    return resident_memory() + GROWTH


def memory_limit(prepared: Prepared, setup: FrameSetup | None = None) -> int:
    """Return the bytes that frames in progress may take: the rest of the job's limit, or a share of the free memory.

    Args:
        setup: with the cells that stay in memory, for all light positions; it may have a few of them only. None: a job
            without cells.
    """
    most = _most_memory(prepared, setup)
    return most if prepared.job.render.memory else min(int(FREE_SHARE * (most + GROWTH)), most)


def _most_memory(prepared: Prepared, setup: FrameSetup | None = None) -> int:
    """Return the bytes beyond which frames in progress do not fit at all; see `memory_limit`."""
    limit, there, table = prepared.job.render.memory, 0, 0
    if setup is not None and setup.indirect.cells is not None:
        there, table = setup.indirect.cells.light.nbytes, cells_memory(setup, prepared.n_lights)
    if limit and builds_cells(prepared):  # the same before and after the build, with kernels loaded or not
        return limit - prepared.held - GROWTH - TREE_PER_TRIANGLE * len(prepared.scene.corners) - table
    return limit - program_memory() if limit else free_memory() + there - table - GROWTH


class LightShare(NamedTuple):
    """The light that hits keep.

    Attributes:
        lit: share of the packets of light positions that light them.
        gathered: share of the hits that have indirect light.
        packed: share of the hits that have a packed column.
    """

    lit: float = 1.0
    gathered: float = 1.0
    packed: float = 1.0


class PilotHits(NamedTuple):
    """The hits of a job, as pilots found them.

    Attributes:
        reflected: the most reflected hits per pixel of a frame, which are held until it is composed.
        of_native, of_reflected: their light.
        behind: share of the hits that are behind glass.
        by_row: (n_windows, 5, n_rows) lit packets, hits with indirect light, with a packed column, and behind glass,
            and reflected hits, in each row of tiles, over the largest mean of a window.
    """

    reflected: float = 0.0
    of_native: LightShare = LightShare()
    of_reflected: LightShare = LightShare()
    behind: float = 1.0
    by_row: Float64 = np.empty((0, 5, 0))


NO_LOOK = PilotHits()


class Share(NamedTuple):
    """A strip's share of the rows of frames, and of the hits that their window holds.

    Attributes:
        shown: share of these hits that any frame shows in the strip; only their light is kept.
        lit, gathered, packed, behind, reflected: what else they have, over what as many hits of whole frames have.
    """

    rows: float
    hits: float
    shown: float = 1.0
    lit: float = 1.0
    gathered: float = 1.0
    packed: float = 1.0
    behind: float = 1.0
    reflected: float = 1.0


WHOLE = Share(1.0, 1.0)


def _least_share(prepared: Prepared) -> Share:
    """Return the share of the thinnest strip; hits of the rows next to it belong to it, as many as it has itself."""
    height = prepared.job.camera.resolution[1]
    if prepared.job.samples.halves or height <= CODED:
        return WHOLE
    return Share(CODED / height, min(2 * CODED / height, 1.0))


def require_memory(prepared: Prepared, per_pixel: Float64 | None = None, setup: FrameSetup | None = None) -> None:
    """Refuse a job of which not even a thin strip at one light position fits into memory; the system would kill it
    without a message.

    Args:
        per_pixel: see `window_memory`.
        setup: see `memory_limit`; None: cells, if any, are still to be built.

    Raises:
        JobError: it does not fit.
    """
    window = window_memory(prepared, 1, per_pixel=per_pixel, share=_least_share(prepared))
    if setup is not None and builds_cells(prepared):
        _require(prepared, window, copied_cells(setup, prepared.n_lights, 1), _most_memory(prepared, setup))
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
    n_lights = prepared.n_lights if prepared.job.indirect.method == "obscurance" else 1  # see `plan._ambient`
    return prepared.threads * BATCH * n_lights * 3 * (4 + 8 + 8)


def window_memory(
    prepared: Prepared,
    n_lights: int,
    look: PilotHits = NO_LOOK,
    per_pixel: Float64 | None = None,
    share: Share = WHOLE,
) -> int:
    """Return the bytes of the window of frames and of the images in progress, for some of the lights.

    Args:
        look, per_pixel, share: see `hits_memory`.
    """
    job, (width, height) = prepared.job, prepared.job.camera.resolution
    layers = 2 * sum(feature.layer_bytes for feature in prepared.features)  # while summed, and while written
    differences = (BLOCKS + 1) * 12 * n_lights * job.samples.halves
    images = BLOCKS * (6 if image_format(job).composes_halves else 12) * n_lights
    hits = hits_memory(prepared, n_lights, look, per_pixel, share)
    rows = height * share.rows
    pixels = int(width * rows * (layers + differences))
    slices = slices_of(job, range(round(rows)), n_lights)
    pixels += width * len(slices[0]) * images
    coded = codes_rows(job)
    if len(slices) > 1 and coded:
        pixels += int(width * rows * FRAMES_CODED * MOST_CODED * n_lights)
    pixels += width * height * JOINED * prepared.threads * (1 if coded else 2)
    if share != WHOLE:  # rows around, whose hits are found
        pixels += width * height * LISTED
    batch = max(LIGHT_ROOM, 2 * 4 * prepared.light_arrays.channels * n_lights * HITS_TOGETHER)  # light of one
    return hits + pixels + prepared.threads * (batch + _gathering_memory(prepared, n_lights))


def hits_memory(
    prepared: Prepared,
    n_lights: int,
    look: PilotHits = NO_LOOK,
    per_pixel: Float64 | None = None,
    share: Share = WHOLE,
) -> int:
    """Return the bytes of the hits of a window, for some of the lights.

    A hit needs its columns, columns of each frame that uses it, and its place in the lists of these frames.

    Args:
        look: at the hits of some frames.
        per_pixel: (n_frames,) mean native hits per pixel of every frame, where these differ; None: as `samples.hits`
            says.
        share: of a strip.
    """
    job = prepared.job
    n_frames, n_r = (1, 0) if prepared.still else (prepared.n_cameras, job.n_r)
    width, height = job.camera.resolution
    held, most = job.hits * (2 * job.n_r + 1), job.hits * (2 * job.n_r + 1 if prepared.still else 1)
    if per_pixel is not None:
        held = max(float(per_pixel[max(j - n_r, 0) : j + n_r + 1].sum()) for j in range(n_frames))
        most = float(per_pixel.max())
    eyes, frames = 2 * n_r + 1, min(2 * n_r + 1, n_frames)
    per_hit, per_frame, per_reflected = _hit_bytes(prepared, n_lights, look, share)
    per_hit += frames * (LISTED + per_frame) + min(look.behind * share.behind, 1.0) * _rare_bytes(prepared, frames)
    # of the frame being traced: the pixel of each hit in every frame of the window, before hits are sorted by it
    finding = most * frames * LISTED
    # where the list of each pixel starts in each frame, and the numbers of native hits that mirrors follow
    lists = frames * (eyes + 1) * LISTED + 2 * LISTED * frames * bool(look.reflected)
    # reflected hits of a frame wait for N_r frames; twice while the lists of all batches are joined
    waiting = look.reflected * share.reflected * (n_r + 2) * (per_reflected + LISTED)
    of_hits, of_rows = held * per_hit + finding, waiting + lists
    per_image_pixel = share.hits * of_hits + share.rows * of_rows
    # a chunk at the edge of a strip that no pilot met
    missed = 0.0 if share == WHOLE else eyes * HITS_TOGETHER * per_hit
    light = _light(prepared, n_lights)
    packed = max(_packed_bytes(prepared, light, mirrored=mirrored) for mirrored in (False, True))
    blocks = eyes * prepared.threads * (1 + (look.reflected > 0)) * block_bytes(light, packed)
    return int(width * height * per_image_pixel + missed) + blocks


def _light(prepared: Prepared, n_lights: int) -> StoredLight:
    arrays = prepared.light_arrays
    return StoredLight(len(arrays.kind), arrays.channels, n_lights)


def _packed_bytes(prepared: Prepared, light: StoredLight, *, mirrored: bool) -> int:
    """Return the bytes of the packed columns of a hit."""
    return bytes_per_hit(column for column in columns_of(prepared.features, light, mirrored=mirrored) if column.packed)


def _rare_bytes(prepared: Prepared, frames: int) -> int:
    """Return the bytes of a hit that has unusual numbers in some frames, such as one behind glass."""
    columns = frame_columns(prepared.features, balance=False, area=False)
    found = bytes_per_hit(column for column in columns if column.usual is not None)
    return frames * found + UNDIMMED_BYTES if found else 0


def _hit_bytes(prepared: Prepared, n_lights: int, look: PilotHits, share: Share) -> tuple[float, int, float]:
    """Return the bytes of a native hit, of that in each frame, and of a reflected hit, for some of the lights."""
    light, features, weights = _light(prepared, n_lights), prepared.features, prepared.job.reuse.weights
    indirect = 0 if prepared.job.indirect.method == "obscurance" else HEAD_BYTES + direct_bytes(light) // 2
    native, reflected = (
        bytes_per_hit(kept_columns(features, light, mirrored=mirrored))
        + min(more.packed * kept.packed, 1.0) * more.shown * _packed_bytes(prepared, light, mirrored=mirrored)
        + min(more.gathered * kept.gathered, 1.0) * more.shown * indirect
        + min(more.lit * kept.lit, 1.0) * more.shown * direct_bytes(light)
        for mirrored, kept, more in ((False, look.of_native, share), (True, look.of_reflected, WHOLE))
    )
    shared = prepared.job.n_r > 0 and not prepared.still
    by_frame = frame_columns(features, balance=weights != "average" and shared, area=weights == "area")
    return native, bytes_per_hit(column for column in by_frame if column.usual is None), reflected


def _gathering_memory(prepared: Prepared, n_lights: int) -> int:
    """Return the bytes per thread for indirect light that grow with the light positions; see `features/indirect.py`."""
    job, values = prepared.job, prepared.light_arrays.channels * n_lights
    if job.indirect.method != "cells":
        return 0
    if job.indirect.exact:
        return 4 * BATCH * (values + 3 * n_lights)
    near = 2 * 2 * MOST_NEAR * values  # of rays too short for cells: irradiance, and what leaves
    smooth = HITS_TOGETHER * values if job.indirect.filter else 0
    return 4 * (near + smooth)


def copied_cells(setup: FrameSetup | None, n_lights: int, size: int) -> int:
    """Return the bytes of cells that a block of light positions holds once more, unless it is the only one."""
    return cells_memory(setup, size) if setup and size < n_lights else 0


def light_blocks(
    prepared: Prepared,
    look: PilotHits = NO_LOOK,
    limit: int | None = None,
    per_pixel: Float64 | None = None,
    setup: FrameSetup | None = None,
    share: Share = WHOLE,
) -> list[range]:
    """Split the light positions into as few blocks of about equal size as the memory limit allows.

    Every block renders the whole camera path and finds its hits again.

    Args:
        limit: bytes; None: `memory_limit`.
        per_pixel, share: see `window_memory`.
        setup: see `memory_limit`.

    Raises:
        JobError: next to the cells not even one light position fits.
    """
    n, most = prepared.n_lights, _most_memory(prepared, setup) if limit is None else limit
    limit = memory_limit(prepared, setup) if limit is None else limit

    def fits(count: int) -> bool:
        size = -(-n // count)
        return window_memory(prepared, size, look, per_pixel, share) + copied_cells(setup, n, size) <= limit

    if setup is not None and builds_cells(prepared):
        _require(prepared, window_memory(prepared, 1, look, per_pixel, share), copied_cells(setup, n, 1), most)
    count = min(1 + bisect_left(range(1, n + 1), True, key=fits), n)
    size = -(-n // count)
    return [range(first, min(first + size, n)) for first in range(0, n, size)]


def builds_cells(prepared: Prepared) -> bool:
    """True if a job builds cells."""
    return prepared.job.indirect.method != "obscurance" and not prepared.job.indirect.exact


def cells_memory(setup: FrameSetup, n_lights: int) -> int:
    """Return the bytes that the light of cells takes at some of the light positions; 0 without cells."""
    return 0 if setup.indirect.cells is None else setup.indirect.cells.light[:, :, :1].nbytes * n_lights


def _expected_cells(prepared: Prepared) -> int:
    """Return the number of cells to come, about; 0 without cells."""
    if not builds_cells(prepared):
        return 0
    samples, edge = prepared.job.indirect.samples, prepared.job.indirect.cell
    if edge is None:
        return int(min(MOST_PER_SAMPLE * samples, PER_ROOT * samples**0.5))
    corners = prepared.scene.corners.astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
    return int(min(MOST_PER_SAMPLE * samples, PER_SQUARE * area / edge**2))


def expected_light(prepared: Prepared, n_lights: int) -> int:
    """Return the bytes that the light of the cells to come will take, about, at some of the light positions."""
    return _expected_cells(prepared) * prepared.light_arrays.channels * n_lights * 4


def expected_table(prepared: Prepared) -> int:
    """Return the bytes of the table of cells to come, about, which stays for the whole render; 0 without cells."""
    return _expected_cells(prepared) * BYTES_PER_CELL + expected_light(prepared, prepared.n_lights)


def expected_build(prepared: Prepared) -> int:
    """Return the bytes that building the cells takes at its peak, about, with the table; 0 without cells."""
    if not builds_cells(prepared):
        return 0
    samples, channels = prepared.job.indirect.samples, prepared.light_arrays.channels
    together = min(LIGHT_BLOCK, prepared.n_lights)
    direct = 4 * channels * together  # of a sample
    solved = (4 * channels + 2 * 4 * 3) * together  # of a cell: direct light, and light of two sweeps
    lit = (PLACED + direct) * samples + _expected_cells(prepared) * solved + expected_table(prepared)
    return max(DRAWN * samples, lit) + prepared.threads * PER_THREAD
