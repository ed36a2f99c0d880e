"""The frame loop [FA alg. 1]: from a job to images and a manifest."""

import time
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from threading import Lock

import numpy as np

from framearray_cli.array.images.images import require_writer
from framearray_cli.array.integrity import OnDisk
from framearray_cli.array.manifest import Manifest
from framearray_cli.array.manifest_toml import write_manifest
from framearray_cli.array.record import Entry, RecordWriter, read_records, record_file
from framearray_cli.base.errors import OutputError
from framearray_cli.engine.embree import Engine
from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.engine.frames.threads import TracePool
from framearray_cli.engine.images.window import Window
from framearray_cli.engine.loop import ready_frames
from framearray_cli.engine.terms.ambient.estimate import Ambient
from framearray_cli.job.job import Job

from .manifest import initial_manifest
from .memory import light_blocks, mirror_share, require_memory
from .prepare import Prepared, image_ambient, plan_work
from .progress import RenderEvents
from .session import RenderSession, complete_manifest, open_session
from .summary import Summary, summarize, with_summary
from .target.pilot import allot_hits
from .writer import ArrayWriter, FinishedFiles, array_target


def render(
    job: Job,
    events: RenderEvents | None = None,
    *,
    engine: Engine = "auto",
    restart: bool = False,
    cameras: Sequence[int] | None = None,
) -> Summary:
    """Render a frame array, or some cameras of it, or what is missing of that in the job's folder.

    Images are the same to the last bit, whether they are rendered in one run or in several.

    Args:
        restart: remove the array that lies in the job's folder first; without it, another array there is an error.
        cameras: those that are wanted, in rising order; None: all.

    Raises:
        JobError, SceneError: the job cannot be rendered.
        OutputError: something could not be written; images that were finished stay, and the next run goes on with the
            rest.
    """
    events, started = events or RenderEvents(), time.perf_counter()
    with open_session(job, events, engine, restart=restart, cameras=cameras) as session:
        prepared, on_disk, directory = session.prepared, session.on_disk, job.output.directory
        if not session.wanted:
            return complete_manifest(session, time.perf_counter() - started)
        setup, ambient, manifest, rays = _plan(session, events)
        with session.folder.exclusive():
            write_manifest(directory, manifest)
        record_path = record_file(directory, session.run.cameras)
        with RecordWriter(record_path, session.identity.fingerprint, session.run) as record:
            run = _Run(prepared, record, events, rays, started)
            try:
                for block in light_blocks(prepared, mirror_share(setup), per_pixel=setup.per_pixel):
                    wanted = on_disk.missing(session.chosen, block)
                    run.frames(setup.for_lights(block), ambient, block, wanted)
            except BaseException:
                with suppress(OutputError), session.folder.exclusive():  # report the first error, not one from here
                    write_manifest(directory, with_summary(manifest, run.summary(on_disk, ambient)))
                raise
        with session.folder.exclusive():
            summary = run.summary(on_disk, ambient)
            write_manifest(directory, with_summary(manifest, summary))
    return summary


def _plan(session: RenderSession, events: RenderEvents) -> tuple[FrameSetup, Ambient, Manifest, Counter[str]]:
    """Find ambient light, hits and manifest of the whole array, and count the rays that they took."""
    prepared, output = session.prepared, session.prepared.job.output
    for name in {output.format, "exr"} if output.layers else {output.format}:
        require_writer(name)
    setup, ambient = plan_work(prepared, session.embree)
    events.planned(ambient)
    setup, target = allot_hits(prepared, setup, ambient)
    rays = Counter({"ambient": ambient.rays})
    if target:
        require_memory(prepared, setup.per_pixel)
        events.allotted(target)
        rays["target"] = target.rays
    return setup, ambient, initial_manifest(prepared, ambient, session.identity, session.settings, target), rays


class _Run:
    """One run of the program over some frames; counts what it took so far."""

    def __init__(
        self, prepared: Prepared, record: RecordWriter, events: RenderEvents, rays: Counter[str], started: float
    ) -> None:
        self._prepared, self._record, self._events, self._started = prepared, record, events, started
        self._rays, self._stages = rays, Counter[str]()
        self._images, self._done, self._lock = 0, set[int](), Lock()
        self._pool: TracePool | None = None

    def frames(self, setup: FrameSetup, ambient: Ambient, lights: range, wanted: Sequence[int]) -> None:
        """Find every frame's hits, compose each frame as soon as its window is complete, write it, forget it.

        Args:
            setup: for a block of light positions, `lights`.
            wanted: cameras whose images are written.
        """
        if not wanted:
            return
        prepared, target = self._prepared, array_target(self._prepared)
        self._pool = pool = TracePool(setup, prepared.threads)
        ambient, half = image_ambient(ambient, prepared.lights), target.format.half
        if setup.lights.n_lights < prepared.n_lights:
            ambient = ambient.for_lights(lights)
        frames = [0] if prepared.still else wanted
        window = Window(setup, ambient, pool)
        writer = ArrayWriter(target, lights, prepared.threads, self._events.written, self._finished)
        try:
            with pool, writer:
                for j in ready_frames(window, setup, frames, pool):
                    block = writer.block()
                    composed = window.compose(j, block)
                    if composed.beyond and half == "auto":  # too bright for halves: some will be floats
                        composed = window.compose(j, np.empty(block.shape, np.float32))
                    writer.write(composed, wanted if prepared.still else [j], block)
                writer.finish()
        finally:
            self._rays += pool.rays()
            self._stages.update(pool.seconds())
            self._pool = None

    def _finished(self, done: FinishedFiles) -> None:
        """Note that all files of a camera are on disk; from any thread."""
        frame, pool = done.composed, self._pool
        notes = []
        if frame.bad:
            notes = [_bad_values(frame.bad, frame.c, frame.first_bad, self._prepared.job.camera.resolution[0])]
        entry = Entry(
            c=done.c,
            lights=(done.planes.start, done.planes.stop),
            files=done.files,
            hits=float(frame.hits.mean()),
            notes=tuple(notes),
            errors=done.errors,
        )
        rays = self._rays + (pool.rays() if pool else Counter[str]())
        self._record.add(entry, rays, time.perf_counter() - self._started)
        with self._lock:
            self._done.add(done.c)
            self._images += len(done.planes)

    def summary(self, on_disk: OnDisk, ambient: Ambient) -> Summary:
        """What this and all other runs did; what was found damaged counts again once it was rendered anew."""
        prepared = self._prepared
        records = read_records(prepared.job.output.directory, self._record.fingerprint)
        bad = {name for name, _ in on_disk.damaged}
        whole = tuple(e for e in records.entries if e.c in self._done or bad.isdisjoint(e.files))
        return summarize(
            prepared,
            replace(records, entries=whole),
            images=self._images,
            seconds=time.perf_counter() - self._started,
            rays=self._rays,
            stages=dict(self._stages),
            notes=ambient.notes,
        )


def _bad_values(count: int, c: int, first: tuple[int, int] | None, width: int) -> str:
    l, pixel = first or (0, 0)
    where = f"camera {c}, light {l}, pixel ({pixel % width}, {pixel // width})"
    return f"{count} values of camera {c} were not finite and were set to 0; the first: {where}"
