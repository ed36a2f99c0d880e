"""Estimate memory, disk space and time of a job without rendering it: `framearray check`."""

import math
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from framearray_cli.array.folder import Identity, conflict_text, differences, free_space, read_array
from framearray_cli.base.memory import free_memory, resident_memory
from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.engine.frames.threads import TracePool
from framearray_cli.engine.images.window import Window
from framearray_cli.engine.kernels.clock import compile_clock
from framearray_cli.engine.loop import ready_frames
from framearray_cli.engine.terms.ambient.estimate import Ambient
from framearray_cli.job.job import Job

from .automatic.choose import AutoSettings, require_least_memory, resolve_auto
from .identity import identity_of
from .memory import ambient_memory, light_blocks, mirror_share, window_memory
from .pilots.warn import find_warnings
from .prepare import Prepared, image_ambient, open_embree, plan_work, prepare
from .target.pilot import Target, allot_hits
from .writer import ArrayWriter, array_target

# Rays of a probe, about, which take one or two seconds.
PROBE_RAYS = 12_000_000
# More pixels per frame add no information; with fewer, threads and batches of hits are less busy than in a render.
MOST_PIXELS, FEWEST_PIXELS = 12_000, 1_000
# Share of the pixels for a first probe, which compiles kernels and shows how file sizes grow with image sizes.
FIRST_SHARE = 0.25


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """Estimated cost of a job.

    Attributes:
        memory: most bytes of the whole program; `available`: bytes that the machine can give it.
        disk: bytes of all images and layers; `free`: bytes free where they go.
        seconds: from start to end, writing included, with kernels compiled before.
        settings: chosen where the job says "auto"; None: no "auto".
        target: hits allotted for the error that the job wants; None: no target.
        blocks: number of blocks of light positions, rendered one after the other because of the memory limit.
        warnings: expected problems.
    """

    prepared: Prepared
    settings: AutoSettings | None
    target: Target | None
    ambient: Ambient
    memory: int
    available: int
    disk: int
    free: int
    seconds: float
    blocks: int
    warnings: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Probe:
    """Measured cost of a few small frames.

    Attributes:
        pixels: per frame.
        seconds: per native hit.
        file_bytes: per frame, all its images and layers.
        writing: seconds to only write a frame; measured only for a camera at rest.
    """

    pixels: int
    seconds: float
    file_bytes: float
    writing: float


def check(job: Job) -> Estimate:
    """Read the inputs of a job, and estimate its cost from a few small frames that are discarded.

    Raises:
        JobError, SceneError: the job cannot be rendered.
        OutputError: the output folder holds a manifest that cannot be read.
    """
    started = time.perf_counter()
    with compile_clock() as clock:
        prepared = prepare(job)
        require_least_memory(prepared)
        with open_embree(prepared) as embree:
            prepared, settings = resolve_auto(prepared, embree)
            identity = identity_of(prepared)
            setup, ambient = plan_work(prepared, embree)
            pilots = find_warnings(prepared, setup, ambient)
            setup, target = allot_hits(prepared, setup, ambient)
            before_frames = time.perf_counter() - started - clock.seconds
            pixels = _probe_pixels(setup)
            first, second = (_probe(prepared, setup, ambient, int(p)) for p in (FIRST_SHARE * pixels, pixels))
            mirrors = mirror_share(setup)
            blocks = light_blocks(prepared, mirrors, per_pixel=setup.per_pixel)
            resident, available = resident_memory(), free_memory()
    scale = setup.n_pixels / second.pixels
    largest = max(len(block) for block in blocks)
    more = max(window_memory(prepared, largest, mirrors, setup.per_pixel), ambient_memory(prepared))
    disk = int(_frame_bytes(first, second, setup.n_pixels) * prepared.n_cameras)
    free = free_space(job.output.directory)
    hits = float(setup.per_pixel.sum()) * setup.n_pixels
    copies = prepared.n_cameras - setup.n_frames  # frames of a camera at rest, which are only written
    return Estimate(
        prepared=prepared,
        settings=settings,
        target=target,
        ambient=ambient,
        memory=resident + more,
        available=resident + available,
        disk=disk,
        free=free,
        seconds=before_frames + second.seconds * hits * _repeats(setup, len(blocks)) + second.writing * scale * copies,
        blocks=len(blocks),
        warnings=(*pilots, *_warnings(job, identity, memory_lacks=more > available, disk_lacks=disk > free)),
    )


def _warnings(job: Job, identity: Identity, *, memory_lacks: bool, disk_lacks: bool) -> tuple[str, ...]:
    found = []
    if memory_lacks:  # a job far beyond the free memory was refused
        found.append("the job may need more memory than is free")
    if disk_lacks:
        found.append("the images need more space than the disk has free")
    folder = job.output.directory
    old = read_array(folder)
    if old is not None and (changed := differences(old, identity)):
        found.append(f"{folder} {conflict_text(old, changed)}")
    return tuple(found)


def _rays_of_a_hit(setup: FrameSetup) -> int:
    """Return the approximate number of rays per hit that do not depend on the lights."""
    return 1 + setup.obscurance.n_rays + (4 if setup.balance else 2) * setup.n_r


def _repeats(setup: FrameSetup, blocks: int) -> float:
    """Return how much longer a render in blocks takes: each finds its hits again."""
    again = _rays_of_a_hit(setup)
    return 1 + (blocks - 1) * again / (again + setup.lights.n_lights)


def _probe_pixels(setup: FrameSetup) -> int:
    """Return the pixels per frame of the second probe."""
    rays = _rays_of_a_hit(setup) + setup.lights.n_lights
    hits = float(np.mean(setup.per_pixel)) * min(2 * setup.n_r + 2, setup.n_frames)
    return int(min(max(PROBE_RAYS / (rays * hits), FEWEST_PIXELS), MOST_PIXELS, setup.n_pixels))


def _small(setup: FrameSetup, pixels: int) -> FrameSetup:
    """Return a few frames from the middle of the path, with about that many pixels each."""
    n = min(2 * setup.n_r + 2, setup.n_frames)
    first = (setup.n_frames - n) // 2
    cams, span = setup.cams, slice(first, first + n)
    shrink = min(math.sqrt(pixels / setup.n_pixels), 1.0)
    width, height = (max(1, round(side * shrink)) for side in (cams.width, cams.height))
    return replace(
        setup,
        cams=cams._replace(
            position=cams.position[span],
            right=cams.right[span],
            up=cams.up[span],
            forward=cams.forward[span],
            focal=cams.focal * height / cams.height,
            width=width,
            height=height,
        ),
        per_pixel=setup.per_pixel[span],
        allotment=None,  # of another resolution; `per_pixel` has its means
    )


def _probe(prepared: Prepared, setup: FrameSetup, ambient: Ambient, pixels: int) -> _Probe:
    """Render and write small frames."""
    small = _small(setup, pixels)
    n, writing = small.n_frames, 0.0
    with TracePool(small, prepared.threads) as pool, tempfile.TemporaryDirectory() as name:
        started = time.perf_counter()
        with _writer(prepared, small, Path(name), pool.threads) as writer:
            window = Window(small, image_ambient(ambient, prepared.lights), pool)
            for j in ready_frames(window, small, range(n), pool):
                composed = window.compose(j, writer.block())
                writer.write(composed, range(j, j + 1))
            writer.finish()
        seconds = time.perf_counter() - started
        file_bytes = sum(file.stat().st_size for file in Path(name).iterdir())
        if prepared.still:
            started = time.perf_counter()
            with _writer(prepared, small, Path(name), pool.threads) as writer:
                writer.write(composed, range(1))
            writing = time.perf_counter() - started
    return _Probe(
        pixels=small.n_pixels,
        seconds=seconds / (float(np.sum(small.per_pixel)) * small.n_pixels),
        file_bytes=file_bytes / n,
        writing=writing,
    )


def _writer(prepared: Prepared, small: FrameSetup, folder: Path, threads: int) -> ArrayWriter:
    target = replace(array_target(prepared), directory=folder, resolution=(small.cams.width, small.cams.height))
    return ArrayWriter(target, range(prepared.n_lights), threads)


def _frame_bytes(first: _Probe, second: _Probe, pixels: int) -> float:
    """Return bytes of a frame's files, a power of its pixels: larger images are smoother and compress better."""
    if first.pixels == second.pixels:
        return second.file_bytes * pixels / second.pixels
    power = math.log(second.file_bytes / first.file_bytes) / math.log(second.pixels / first.pixels)
    return float(second.file_bytes * (pixels / second.pixels) ** min(max(power, 0.5), 1.0))
