"""Open a render session: read the inputs, claim the output folder, and find what is left to do."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from framearray_cli.array.celltable import remove_table
from framearray_cli.array.coarsearray import remove_left_coarse
from framearray_cli.array.folder import ArrayFolder, Identity, check_folder, claim_folder, read_array
from framearray_cli.array.integrity import OnDisk, scan_output
from framearray_cli.array.manifest import Manifest
from framearray_cli.array.manifest_toml import read_manifest, write_manifest
from framearray_cli.array.places import frames_text
from framearray_cli.array.record import MOST, RecordedRun, RecordWriter, record_file
from framearray_cli.array.stripfiles import remove_strips
from framearray_cli.base.errors import OutputError
from framearray_cli.base.threads import TaskPool
from framearray_cli.base.units import agree, counted
from framearray_cli.engine.embree.embreescene import EmbreeScene
from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.engine.kernels.processor import processor
from framearray_cli.job.job import Job

from .automatic import AutoSettings, require_least_memory, resolve_auto
from .cells import SharedCells, cells_digest
from .events import Report, Scanned, Started, Working, note
from .identity import identity_of, scene_fingerprint
from .manifest import Summary, summarize, with_summary
from .messages import scene_lines, settings_lines
from .prepare import Prepared, open_embree, prepare


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RenderSession:
    """A render whose inputs, folder and remaining work are known.

    Attributes:
        settings: chosen where the job says "auto"; `prepared` has the numbers. None: no "auto".
        run: entry of this run in the record.
        folder: the output folder; `on_disk`: its whole files.
        chosen: cameras that were asked for; `wanted`: those that lack an image.
    """

    prepared: Prepared
    embree: EmbreeScene
    settings: AutoSettings | None
    identity: Identity
    run: RecordedRun
    folder: ArrayFolder
    on_disk: OnDisk
    chosen: Sequence[int]
    wanted: list[int]

    @property
    def cells(self) -> SharedCells:
        """The cells in the folder, for jobs that need any."""
        return SharedCells(
            folder=self.folder,
            directory=self.prepared.job.output.directory,
            array=self.identity.fingerprint,
            cameras=self.run.cameras,
            n_lights=self.prepared.n_lights,
        )

    def known_warnings(self) -> tuple[str, ...]:
        """Return the warnings in the manifest, if another run or part has written one."""
        known = read_array(self.prepared.job.output.directory)
        return _texts(known, "warnings") if known else ()


@contextmanager
def open_session(job: Job, report: Report, *, restart: bool, cameras: Sequence[int] | None) -> Iterator[RenderSession]:
    """Read the inputs of a job, claim its folder, lock its cameras, and scan the files on disk; see `render`.

    Raises:
        JobError, SceneError, OutputError: as `render`.
    """
    prepared = prepare(job)
    report_start(prepared, report, "reading the output folder")
    require_least_memory(prepared)
    directory = job.output.directory
    chosen = range(prepared.n_cameras) if cameras is None else cameras
    with TaskPool(1, thread_name_prefix="fingerprint") as aside:  # both take as long, and need no Python
        scene = aside.submit(scene_fingerprint, prepared)
        built = open_embree(prepared)
    with built as embree, ExitStack() as held:
        prepared, settings = resolve_auto(prepared, embree)
        identity = identity_of(prepared, scene.result())
        run = RecordedRun(cameras=frames_text(chosen), processor=processor())
        check_folder(directory, identity, restart=restart)
        folder = ArrayFolder(directory)
        with folder.exclusive():
            if restart:
                folder.require_no_other_run()
            if files := claim_folder(directory, identity, restart=restart):
                note(report, [f"removed {counted(files, 'file')} of the frame array in {directory}"])
            note(report, folder.take_over_metadata(identity, prepared.job.output.fps))
            remove_left_coarse(directory)
            held.enter_context(folder.reserve(chosen, run.cameras))
        if settings:
            note(report, settings_lines(settings))

        def comparing(files: int) -> None:
            sums = agree(files, "its checksum", "their checksums")
            report(Working(text=f"comparing {counted(files, 'file')} with {sums}"))

        on_disk = scan_output(directory, identity.fingerprint, prepared.threads, frozenset(chosen), comparing)
        wanted = on_disk.missing(chosen, range(prepared.n_lights))
        report(Scanned(kept=on_disk.images, wanted=len(wanted) * prepared.n_lights, damaged=dict(on_disk.damaged)))
        report(Working(text="estimating the ambient light"))
        yield RenderSession(
            prepared=prepared, embree=embree, settings=settings, identity=identity, run=run, folder=folder,
            on_disk=on_disk, chosen=chosen, wanted=wanted,
        )  # fmt: skip


def begin_record(session: RenderSession, setup: FrameSetup, manifest: Manifest) -> RecordWriter:
    """Write the manifest of an array that begins, and note this run in its record.

    Raises:
        OutputError: images that are there, or runs that go on, have other cells.
    """
    directory, cells = session.prepared.job.output.directory, cells_digest(setup.indirect.cells)
    with session.folder.exclusive():
        if cells:
            session.cells.require_same(cells)
        write_manifest(directory, manifest)
        path, run = record_file(directory, session.run.cameras), replace(session.run, cells=cells)
        return RecordWriter(path, session.identity.fingerprint, run)


def report_start(prepared: Prepared, report: Report, then: str) -> None:
    """Report the size of an array, the contents of its scene, and the work that begins."""
    job = prepared.job
    report(
        Started(
            name=job.name,
            folder=job.output.directory,
            cameras=prepared.n_cameras,
            images=prepared.n_cameras * prepared.n_lights,
            resolution=job.camera.resolution,
            triangles=prepared.scene.report.triangles,
        )
    )
    note(report, scene_lines(prepared))
    report(Working(text=then))


def complete_manifest(session: RenderSession, seconds: float) -> Summary:
    """Summarize a render that has nothing left to do; complete the manifest if it does not say so yet."""
    prepared, directory = session.prepared, session.prepared.job.output.directory
    with session.folder.exclusive():
        manifest = read_manifest(directory)
        summary = summarize(prepared, session.on_disk.records, seconds=seconds, notes=_texts(manifest, "notes"))
        known = manifest.summary.get("images") == summary.there and manifest.summary.get("finished")
        write_summary(directory, None if known else manifest, summary)
    return summary


def _texts(manifest: Manifest, key: str) -> tuple[str, ...]:
    """Return the texts that a manifest's summary lists under a key."""
    found = manifest.summary.get(key)
    return tuple(text for text in found if isinstance(text, str)) if isinstance(found, list) else ()


def write_summary(directory: Path, manifest: Manifest | None, summary: Summary) -> None:
    """Write the manifest after a run, and remove the cells of an array that is finished; enter it within `exclusive`.

    Args:
        manifest: without the summary; None: the folder's manifest has it.

    Raises:
        OutputError: images have light from different cells, or the manifest cannot be written.
    """
    if summary.mixed_cells:
        raise OutputError(f"{directory}: {summary.mixed_cells}")
    if manifest is not None:
        write_manifest(directory, with_summary(manifest, summary))
    if summary.there == summary.images:
        remove_table(directory)
        remove_strips(directory, range(MOST))
