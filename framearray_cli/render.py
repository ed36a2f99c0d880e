"""The frame loop [FA alg. 1]: from a job to images and a manifest."""

import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from threading import Lock

import numpy as np

from .auto import Choice, require_least_memory, settled
from .crew import TracePool
from .describe import describe, identity_of
from .embree import EmbreeScene, Engine
from .errors import OutputError
from .folderlock import Folder
from .images import require_writer
from .job import Job
from .kernel import processor
from .loop import ready_frames
from .manifest import Manifest
from .manifestfile import read_manifest, write_manifest
from .memory import light_blocks, mirror_share, require_memory
from .outfolder import Identity, check_folder, claim_folder
from .prepare import Prepared, composed_with, open_embree, plan_work, prepare
from .ranges import frames_text
from .record import Entry, RecordWriter, Session, read_records, record_file
from .resume import Found, look
from .summary import Summary, summed, with_summary
from .target import Target, aimed
from .terms.ambient import Ambient
from .window import Window
from .work import FrameSetup
from .writer import ArrayWriter, FinishedFiles, array_target


class Listener:
    """What a render tells while it runs; override what you want to hear. Calls may come from any thread."""

    def prepared(self, prepared: Prepared) -> None:
        """Inputs were read."""

    def removed(self, files: int) -> None:
        """That many files of the array that lay in the folder were removed."""

    def settled(self, choice: Choice) -> None:
        """What the job leaves open was chosen."""

    def looking(self, files: int) -> None:
        """So many files of the array are there, and are compared with their checksums."""

    def found(self, found: Found, wanted: int) -> None:
        """What of the array is there already, and how many images will be rendered."""

    def planned(self, ambient: Ambient) -> None:
        """The ambient light is known."""

    def aimed(self, target: Target) -> None:
        """Native hits were allotted for the error that the job wants."""

    def written(self, images: int) -> None:
        """That many more images are on disk."""

    def waits(self, what: str) -> None:
        """In parts: something is waited for."""

    def handed_out(self, line: str) -> None:
        """In parts: the camera path was cut, and workers begin."""

    def heard(self, lines: Sequence[str]) -> None:
        """In parts: what the first of them tells of the whole array."""

    def compiling(self) -> None:
        """In parts: a worker compiles kernels."""


def render(
    job: Job,
    listener: Listener | None = None,
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
    listener, started = listener or Listener(), time.perf_counter()
    with begun(job, listener, engine, restart=restart, cameras=cameras) as start:
        prepared, found, place, folder = start.prepared, start.found, start.place, job.output.directory
        if not start.wanted:
            with place.alone():
                return nothing_to_do(prepared, found, time.perf_counter() - started)
        work, ambient, manifest, rays = _planned(start, listener)
        with place.alone():
            write_manifest(folder, manifest)
        fingerprint = start.identity.fingerprint
        with RecordWriter(record_file(folder, start.session.cameras), fingerprint, start.session) as record:
            run = _Run(prepared, record, listener, rays, started)
            try:
                for block in light_blocks(prepared, mirror_share(work), per_pixel=work.per_pixel):
                    wanted = found.missing(start.chosen, block)
                    run.frames(work.for_lights(block), ambient, block, wanted)
            except BaseException:
                with suppress(OutputError), place.alone():  # what stopped the render is told, not what that meets
                    write_manifest(folder, with_summary(manifest, run.summary(found, ambient)))
                raise
        with place.alone():
            summary = run.summary(found, ambient)
            write_manifest(folder, with_summary(manifest, summary))
    return summary


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Begun:
    """A render that knows what it has to do.

    Attributes:
        choice: of what the job leaves open; `prepared` has numbers for it.
        place: the output folder; `found`: what is there.
        chosen: cameras that were asked for; `wanted`: those of them of which something is missing.
    """

    prepared: Prepared
    embree: EmbreeScene
    choice: Choice | None
    identity: Identity
    session: Session
    place: Folder
    found: Found
    chosen: Sequence[int]
    wanted: list[int]


@contextmanager
def begun(
    job: Job, listener: Listener, engine: Engine = "auto", *, restart: bool, cameras: Sequence[int] | None
) -> Iterator[Begun]:
    """Read what a job names, claim its folder, keep other runs off its cameras, and look what is there; see `render`.

    Raises:
        JobError, SceneError, OutputError: as `render`.
    """
    prepared = prepare(job)
    listener.prepared(prepared)
    require_least_memory(prepared)
    folder = job.output.directory
    chosen = range(prepared.n_cameras) if cameras is None else cameras
    with open_embree(prepared, engine) as embree, ExitStack() as held:
        prepared, choice = settled(prepared, embree)
        identity = identity_of(prepared)
        session = Session(cameras=frames_text(chosen), processor=processor())
        check_folder(folder, identity, restart=restart)
        place = Folder(folder)
        with place.alone():
            if restart:
                place.require_no_other()
            listener.removed(claim_folder(folder, identity, restart=restart))
            held.enter_context(place.reserved(chosen, session.cameras))
        if choice:
            listener.settled(choice)
        found = look(folder, identity.fingerprint, prepared.threads, frozenset(chosen), listener.looking)
        wanted = found.missing(chosen, range(prepared.n_lights))
        listener.found(found, len(wanted) * prepared.n_lights)
        yield Begun(
            prepared=prepared, embree=embree, choice=choice, identity=identity, session=session, place=place,
            found=found, chosen=chosen, wanted=wanted,
        )  # fmt: skip


def _planned(start: Begun, listener: Listener) -> tuple[FrameSetup, Ambient, Manifest, Counter[str]]:
    """Ambient light, hits and manifest of the whole array, and the rays that they took."""
    prepared, output = start.prepared, start.prepared.job.output
    for name in {output.format, "exr"} if output.layers else {output.format}:
        require_writer(name)
    work, ambient = plan_work(prepared, start.embree)
    listener.planned(ambient)
    work, target = aimed(prepared, work, ambient)
    rays = Counter({"ambient": ambient.rays})
    if target:
        require_memory(prepared, work.per_pixel)
        listener.aimed(target)
        rays["target"] = target.rays
    return work, ambient, describe(prepared, ambient, start.identity, start.choice, target), rays


def nothing_to_do(prepared: Prepared, found: Found, seconds: float) -> Summary:
    """All that is wanted is on disk; the manifest may not say so yet."""
    folder = prepared.job.output.directory
    manifest = read_manifest(folder)
    known = manifest.summary.get("notes")
    notes = tuple(note for note in known if isinstance(note, str)) if isinstance(known, list) else ()
    summary = summed(prepared, found.records, images=0, seconds=seconds, rays=Counter(), stages={}, notes=notes)
    if manifest.summary.get("images") != summary.there or not manifest.summary.get("finished"):
        write_manifest(folder, with_summary(manifest, summary))
    return summary


class _Run:
    """One run of the program over some frames; knows what it took so far."""

    def __init__(
        self, prepared: Prepared, record: RecordWriter, listener: Listener, rays: Counter[str], started: float
    ) -> None:
        self._prepared, self._record, self._listener, self._started = prepared, record, listener, started
        self._rays, self._stages = rays, Counter[str]()
        self._images, self._done, self._lock = 0, set[int](), Lock()
        self._crew: TracePool | None = None

    def frames(self, work: FrameSetup, ambient: Ambient, lights: range, wanted: Sequence[int]) -> None:
        """Find every frame's hits, compose each frame as soon as its window is complete, write it, forget it.

        Args:
            work: for a block of light positions, `lights`.
            wanted: cameras whose images are written.
        """
        if not wanted:
            return
        prepared, target = self._prepared, array_target(self._prepared)
        self._crew = crew = TracePool(work, prepared.threads)
        ambient, half = composed_with(ambient, prepared.lights), target.format.half
        if work.lights.n_lights < prepared.n_lights:
            ambient = ambient.for_lights(lights)
        frames = [0] if prepared.still else wanted
        window = Window(work, ambient, crew)
        writer = ArrayWriter(target, lights, prepared.threads, self._listener.written, self._finished)
        try:
            with crew, writer:
                for j in ready_frames(window, work, frames, crew):
                    block = writer.block()
                    composed = window.compose(j, block)
                    if composed.beyond and half == "auto":  # too bright for halves: some will be floats
                        composed = window.compose(j, np.empty(block.shape, np.float32))
                    writer.write(composed, wanted if prepared.still else [j], block)
                writer.finish()
        finally:
            self._rays += crew.rays()
            self._stages.update(crew.seconds())
            self._crew = None

    def _finished(self, done: FinishedFiles) -> None:
        """Note that all files of a camera are on disk; from any thread."""
        frame, crew = done.composed, self._crew
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
        rays = self._rays + (crew.rays() if crew else Counter[str]())
        self._record.add(entry, rays, time.perf_counter() - self._started)
        with self._lock:
            self._done.add(done.c)
            self._images += len(done.planes)

    def summary(self, found: Found, ambient: Ambient) -> Summary:
        """What this and all other runs did; what was found damaged counts again once it was rendered anew."""
        prepared = self._prepared
        records = read_records(prepared.job.output.directory, self._record.fingerprint)
        bad = {name for name, _ in found.damaged}
        whole = tuple(e for e in records.entries if e.c in self._done or bad.isdisjoint(e.files))
        return summed(
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
