"""Estimate memory, disk space and time of a job without rendering it: `framearray check`."""

import time
from dataclasses import dataclass, replace

import numpy as np

from framearray_cli.array.folder import Identity, conflict_text, differences, free_space, read_array
from framearray_cli.base.memory import free_memory, resident_memory
from framearray_cli.base.platform import largest_size
from framearray_cli.base.units import counted, duration, in_unit_of, size
from framearray_cli.engine.embree.library import packet_width
from framearray_cli.engine.features.indirect import Obscurances
from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.engine.kernels.clock import compile_clock
from framearray_cli.engine.terms.ambient.intensity import Ambient
from framearray_cli.job.job import Job

from .automatic import AutoSettings, require_least_memory, resolve_auto
from .cells import table_bytes
from .division import Division, divide
from .errortarget import Target, allot_hits
from .events import AmbientEstimated, HitsAllotted, Report, Working, ignore, note
from .identity import identity_of
from .memory import ambient_memory, cells_memory
from .messages import settings_lines
from .pace import NO_WORK, Cost, Work, block_work, hit_cost, pixel_cost
from .pilots.warn import find_warnings
from .plan import plan_work
from .prepare import Prepared, open_embree, prepare
from .session import report_start
from .trial import (
    Trial,
    all_lights,
    few_prepared,
    frame_bytes,
    lacking_space,
    load_kernels,
    n_small_frames,
    run_trial,
    writing_cost,
)

# Rays of a trial, about, which take one or two seconds.
TRIAL_RAYS = 12_000_000
# More pixels per frame add no information; with fewer, threads and batches of hits are less busy than in a render.
MOST_PIXELS, FEWEST_PIXELS = 12_000, 1_000
# Light positions that stand for all, at most about: of more, each costs what these cost.
MOST_LIGHTS = 36


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """Estimated cost of a job.

    Attributes:
        memory: most bytes of the whole program; `available`: bytes that the machine can give it.
        disk: bytes of all images and layers; `free`: bytes free where they go.
        disk_cells: bytes of the cells that lie next to them until all are there.
        seconds: from start to end, writing included, with kernels compiled before.
        settings: chosen where the job says "auto"; None: no "auto".
        target: hits allotted for the error that the job wants; None: no target.
        division: parts that are rendered one after the other because of the memory limit.
        warnings: expected problems.
    """

    prepared: Prepared
    settings: AutoSettings | None
    target: Target | None
    ambient: Ambient
    memory: int
    available: int
    disk: int
    disk_cells: int
    free: int
    seconds: float
    division: Division
    warnings: tuple[str, ...]


def check(job: Job, report: Report = ignore) -> Estimate:
    """Read the inputs of a job, and estimate its cost from a few small frames that are discarded.

    Of many light positions it looks at a few only.

    Args:
        report: receives events as they happen.

    Raises:
        JobError, SceneError: the job cannot be rendered.
        OutputError: the output folder holds a manifest that cannot be read.
    """
    started = time.perf_counter()
    with compile_clock() as clock:

        def now() -> float:
            return time.perf_counter() - started - clock.seconds

        prepared = prepare(job)
        report_start(prepared, report, "estimating the ambient light")
        require_least_memory(prepared)
        with open_embree(prepared) as embree:
            prepared, settings = resolve_auto(prepared, embree)
            note(report, settings_lines(settings) if settings else ())
            identity = identity_of(prepared)
            few, before = few_prepared(prepared, MOST_LIGHTS), now()
            setup, ambient = plan_work(few, embree)
            ambient_seconds, peak = now() - before, largest_size()
            report(AmbientEstimated.of(ambient))
            report(Working(text="rendering a few small frames"))
            pilots = find_warnings(prepared, *all_lights(prepared, MOST_LIGHTS, setup, ambient))
            before_target = now()
            setup, target = allot_hits(few, setup, ambient)
            if target:
                report(HitsAllotted(target=target))
            planning = ambient_seconds + now() - before_target
            load_kernels(few, setup, ambient)
            resident = resident_memory()
            each = frame_bytes(few, setup, ambient, prepared.n_lights)
            trial = run_trial(few, setup, ambient, _trial_pixels(setup))
            division = divide(prepared, setup, exact=True)
            memory = _memory(prepared, setup, division, resident, peak)
    disk, free = int(each * prepared.n_cameras), free_space(job.output.directory)
    disk_cells = table_bytes(setup.indirect.cells, prepared.n_lights) if setup.indirect.cells else 0
    seconds = before + planning_seconds(planning, ambient.shared_s, prepared.n_lights / few.n_lights)
    return Estimate(
        prepared=prepared,
        settings=settings,
        target=target,
        ambient=ambient,
        memory=memory[0],
        available=memory[1],
        disk=disk,
        disk_cells=disk_cells,
        free=free,
        seconds=seconds + _frame_seconds(prepared, setup, ambient, trial, division),
        division=division,
        warnings=(*pilots, *_warnings(job, identity, setup, memory, (disk + disk_cells, free), division)),
    )


def _memory(prepared: Prepared, setup: FrameSetup, division: Division, resident: int, peak: int) -> tuple[int, int]:
    """Return the most bytes of the program, and the bytes that the machine can give it.

    Args:
        setup: for the light positions of the trial.
        resident: bytes of the program before its first frame; `peak`: the most before that.
    """
    left_out = cells_memory(setup, prepared.n_lights - setup.lights.n_lights)
    of_frames = max(division.memory, peak - resident if setup.indirect.cells else 0)
    return resident + max(left_out + of_frames, ambient_memory(prepared)), resident_memory() + free_memory()


def planning_seconds(measured: float, shared: float, more_lights: float) -> float:
    """Return the seconds of planning at more light positions, of which `shared` do not grow with them."""
    return shared + max(measured - shared, 0.0) * more_lights


def _frame_seconds(prepared: Prepared, few: FrameSetup, ambient: Ambient, trial: Trial, division: Division) -> float:
    """Return the expected seconds of all frames, at all light positions.

    Args:
        few, ambient: for the light positions of the trial.
    """
    whole, _ = all_lights(prepared, MOST_LIGHTS, replace(few, indirect=Obscurances(few.indirect.settings)), ambient)
    n, largest = few.lights.n_lights, max(len(block) for block in division.blocks)
    cost, larger = trial.cost, few.n_pixels / trial.pixels
    each = Work(
        hits=cost.each.hits * hit_cost(few, largest) / hit_cost(few, n),
        planes=cost.each.planes * larger * pixel_cost(few, largest) / pixel_cost(few, n),
        images=writing_cost(prepared, trial.image),
        layers=cost.each.layers * larger,
    )
    cameras = range(prepared.n_cameras)
    of_blocks = (block_work(whole.for_block(block), cameras, still=prepared.still) for block in division.blocks)
    work = sum(of_blocks, NO_WORK)
    work = work._replace(hits=work.hits * division.hits / len(division.blocks))
    return Cost(each=each, busy=cost.busy).seconds(work)


def _warnings(
    job: Job,
    identity: Identity,
    setup: FrameSetup,
    memory: tuple[int, int],
    disk: tuple[int, int],
    division: Division,
) -> tuple[str, ...]:
    """Find what may not fit; of memory and disk both what is needed and what there is."""
    found, limit = [f"the job would be {division.text}"] if division.is_slow else [], job.render.memory
    if memory[0] > memory[1]:  # a job far beyond the free memory was refused
        found.append("the job may need more memory than is free")
    if limit is not None and setup.indirect.cells is not None and memory[0] > limit:
        needed, most = (in_unit_of(n, limit) for n in (memory[0], limit))
        found.append(f"the job may take {needed} of memory, more than {most}; a smaller indirect.samples takes less")
    if lacking := lacking_space(job, *disk):
        found.append(lacking)
    folder = job.output.directory
    old = read_array(folder)
    if old is not None and (changed := differences(old, identity)):
        found.append(f"{folder} {conflict_text(old, changed)}")
    return tuple(found)


def _trial_pixels(setup: FrameSetup) -> int:
    """Return the pixels per frame of the trial."""
    other_rays = 1 + setup.indirect.settings.n_rays + (4 if setup.balance else 2) * setup.n_r
    rays = other_rays + setup.lights.n_lights  # per hit, about
    hits = float(np.mean(setup.per_pixel)) * (n_small_frames(setup) + 2 * setup.n_r)
    return int(min(max(TRIAL_RAYS / (rays * hits), FEWEST_PIXELS), MOST_PIXELS, setup.n_pixels))


def cost_lines(estimate: Estimate) -> list[str]:
    """Describe the expected cost of a job."""
    folder = estimate.prepared.job.output.directory
    cells = f", and {size(estimate.disk_cells)} of cells until it is finished" if estimate.disk_cells else ""
    parts = f"; {estimate.division.text}" if estimate.division.text else ""
    together = counted(packet_width(), "ray")
    return [
        f"memory: about {size(estimate.memory)}, {size(estimate.available)} free{parts}",
        f"disk: about {size(estimate.disk)} in {folder}{cells}, {size(estimate.free)} free",
        f"time: about {duration(estimate.seconds)} on this machine, where Embree traces {together} together",
    ]
