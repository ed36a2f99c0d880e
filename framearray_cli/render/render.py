"""The frame loop [FA alg. 1]: from a job to images and a manifest."""

import time
from collections import Counter
from collections.abc import Sequence
from contextlib import nullcontext, suppress

from framearray_cli.array.manifest import Manifest
from framearray_cli.array.manifest_toml import write_manifest
from framearray_cli.base.errors import JobError, OutputError
from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.engine.terms.ambient.intensity import Ambient
from framearray_cli.job.job import Job

from .coarse import coarse_beside
from .division import RenderPart, find_parts
from .errortarget import allot_hits
from .events import (
    AmbientEstimated,
    HitsAllotted,
    KernelsLoaded,
    Report,
    Warned,
    Working,
    ignore,
)
from .filesize import find_lacking_space
from .frames import compose_frames
from .manifest import initial_manifest
from .memory import require_memory
from .pace import eye_work
from .pilots.warn import find_warnings
from .plan import plan_work
from .session import RenderSession, begin_record, complete_manifest, open_session, write_summary
from .summary import Summary, with_summary
from .totals import RunTotals
from .trial import AnyImage, load_kernels
from .writer import array_target


def render(
    job: Job,
    report: Report = ignore,
    *,
    restart: bool = False,
    cameras: Sequence[int] | None = None,
    pilots: bool = True,
    coarse: bool = False,
    strict: bool = False,
) -> Summary:
    """Render a frame array, or some of its cameras; images that lie in the job's folder already are kept.

    Images are the same to the last bit, whether rendered in one run or in several.

    Args:
        restart: first remove the array in the job's folder; otherwise another array there is an error.
        cameras: those to render, in rising order; None: all.
        pilots: whether to look for what would make the array useless; False for parts of a render that did.
        report: receives events, in any thread; an error that it raises ends the render.
        coarse: whether small pictures come first, next to the array, until it is there; see `render/coarse.py`.
        strict: warnings are errors.

    Raises:
        JobError, SceneError: the job cannot be rendered.
        OutputError: a file could not be written; finished images stay, and the next run renders the rest.
    """
    started = time.perf_counter()
    with open_session(job, report, restart=restart, cameras=cameras) as session:
        if not session.wanted:
            return complete_manifest(session, time.perf_counter() - started)
        with coarse_beside(session, report) if coarse else nullcontext():
            return _render(session, report, started, pilots=pilots, strict=strict)


def _render(session: RenderSession, report: Report, started: float, *, pilots: bool, strict: bool) -> Summary:
    """Render what is missing; `started` is when the run began, by `time.perf_counter`."""
    prepared, on_disk, directory = session.prepared, session.on_disk, session.prepared.job.output.directory
    setup, ambient, manifest, rays, sample = _plan(session, report, pilots=pilots, strict=strict)
    with begin_record(session, setup, manifest) as record:
        run = RunTotals(prepared, record, report, rays, started)
        try:
            parts = find_parts(session, setup, report)
            run.begin(setup, sample, parts)
            for part in parts:
                _render_part(run, part, ambient)
        except BaseException:
            with suppress(OutputError), session.folder.exclusive():  # report the first error, not one from here
                write_manifest(directory, with_summary(manifest, run.summary(on_disk, ambient)))
            raise
    with session.folder.exclusive():
        summary = run.summary(on_disk, ambient)
        write_summary(directory, manifest, summary)
    return summary


def _plan(
    session: RenderSession, report: Report, *, pilots: bool, strict: bool
) -> tuple[FrameSetup, Ambient, Manifest, Counter[str], AnyImage]:
    """Estimate the ambient light, render pilots, allot hits, and build the manifest; count the rays traced."""
    prepared = session.prepared
    setup, ambient = plan_work(prepared, session.embree, share=session.cells.take)
    report(AmbientEstimated.of(ambient))
    report(Working(text="loading kernels"))
    sample = load_kernels(prepared, setup, ambient)
    report(KernelsLoaded())
    report(Working(text="preparing frames"))
    if pilots and (0 in session.chosen or not session.on_disk.records.entries):  # later parts need not look again
        warnings = find_warnings(prepared, setup, ambient)
        report_warnings(prepared.job, warnings, report, strict=strict)
    else:
        warnings = session.known_warnings()
    setup, target = allot_hits(prepared, setup, ambient)
    rays = Counter({"ambient": ambient.rays})
    if target:
        require_memory(prepared, setup.per_pixel, setup)
        report(HitsAllotted(target=target))
        rays["target"] = target.rays
    if pilots:
        report_lacking_space(session, setup, ambient, report, strict=strict)
    manifest = initial_manifest(prepared, ambient, session.identity, session.settings, target, warnings)
    return setup, ambient, manifest, rays, sample


def report_warnings(job: Job, warnings: Sequence[str], report: Report, *, strict: bool) -> None:
    """Report warnings.

    Raises:
        JobError: there are some, and they are errors.
    """
    if strict and warnings:
        raise JobError(job.file or job.name, warnings)
    for text in warnings:
        report(Warned(text=text))


def report_lacking_space(
    session: RenderSession, setup: FrameSetup, ambient: Ambient, report: Report, *, strict: bool
) -> None:
    """Report if the missing files need more space than the disk has free.

    Raises:
        JobError: as `report_warnings`.
        OutputError: as `find_lacking_space`.
    """
    prepared, n = session.prepared, session.prepared.n_lights
    missing = session.on_disk.missing_images(session.wanted, n) / n  # a part of a camera position counts as its share
    found = find_lacking_space(prepared, setup, ambient, missing)
    report_warnings(prepared.job, found, report, strict=strict)


def _render_part(run: RunTotals, part: RenderPart, ambient: Ambient) -> None:
    """Render the wanted cameras at a block of light positions [FA alg. 1].

    Trace the hits of each frame, compose a frame as soon as the hits of its window are there, and write it.

    Args:
        ambient: for all light positions.
    """
    setup, lights, wanted = part.setup, part.lights, part.wanted
    target, still = array_target(run.prepared), run.prepared.still
    exact = target.format.half == "auto"
    with run.open_pool(setup) as pool, run.open_writer(target, part) as writer:
        frames = compose_frames(
            run.prepared, setup, ambient, pool, [0] if still else wanted, writer.block, lights,
            slices=part.slices, exact=exact, found=lambda c: run.pace.found(eye_work(setup, c)),
        )  # fmt: skip
        for composed, images in frames:
            run.pace.composed(len(lights) * len(composed.rows) / setup.cams.height)
            writer.write(composed, wanted if still else [composed.c], images)
        writer.finish()
