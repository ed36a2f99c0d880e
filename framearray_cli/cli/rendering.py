"""Lines that `render` prints while it works."""

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from framearray_cli.base.errors import OutputError
from framearray_cli.base.units import agree, counted, size
from framearray_cli.render.messages import (
    ambient_lines,
    chunks_line,
    on_disk_lines,
    scene_lines,
    settings_lines,
    target_lines,
    warning_lines,
    workers_text,
)
from framearray_cli.render.parts.progress import PartEvents
from framearray_cli.render.progress import ambient_figures

from .live import LivePage, coarse_line
from .options import refuse_warnings
from .screen import Screen

if TYPE_CHECKING:
    from framearray_cli.array.integrity import OnDisk
    from framearray_cli.array.manifest import Manifest
    from framearray_cli.engine.terms.ambient.intensity import Ambient
    from framearray_cli.job.job import Job
    from framearray_cli.render.automatic import AutoSettings
    from framearray_cli.render.errortarget import Target
    from framearray_cli.render.parts.chunks import Chunks
    from framearray_cli.render.prepare import Prepared
    from framearray_cli.render.progress import AmbientFigures, CoarseFigures


class RenderingEvents(PartEvents):
    """Print the scene, then the ambient light, then a progress bar.

    Attributes:
        printed: notes that were printed.
    """

    def __init__(
        self, screen: Screen, job: "Job", *, strict: bool = False, repairs: bool = False, page: LivePage | None = None
    ) -> None:
        self._screen, self._job, self._strict, self._repairs, self._page = screen, job, strict, repairs, page
        self._total = 0
        self.printed: tuple[str, ...] = ()

    def prepared(self, prepared: "Prepared") -> None:
        self._screen.say(scene_lines(prepared))
        self._screen.wait("reading the output folder")

    def removed(self, files: int) -> None:
        if files:
            self._screen.say([f"removed {counted(files, 'file')} of the frame array in {self._job.output.directory}"])

    def rewriting(self, files: int) -> None:
        if files:
            rate = f"output.fps is {self._job.output.fps:g} now"
            self._screen.say([f"{rate}: rewriting the headers of {counted(files, 'file')}, whose pixels stay"])

    def keeping_compression(self, compression: str) -> None:
        line = f"output.compression is {compression} now: files that are there keep theirs, which holds the same pixels"
        self._screen.say([line])

    def resolved(self, settings: "AutoSettings") -> None:
        self._screen.say(settings_lines(settings))

    def scanning(self, files: int) -> None:
        self._screen.wait(f"comparing {counted(files, 'file')} with {agree(files, 'its checksum', 'their checksums')}")

    def scanned(self, on_disk: "OnDisk", wanted: int) -> None:
        self._total = wanted
        self._screen.say(on_disk_lines(on_disk, wanted, damaged=not self._repairs))
        self._screen.wait("estimating the ambient light")

    def coarse_begins(self, array: "Manifest") -> None:
        if self._page:
            self._page.open(array, self._screen)
        self._screen.wait("rendering coarse pictures")

    def coarse_ends(self, coarse: "CoarseFigures") -> None:
        self._screen.say([coarse_line(coarse)])
        self._screen.wait("estimating the ambient light")

    def planned(self, ambient: "Ambient") -> None:
        self._screen.say(ambient_lines(ambient_figures(ambient)))
        self.printed = ambient.notes
        self._screen.wait("loading kernels")

    def loaded(self) -> None:
        self._screen.compiled()
        self._screen.wait("preparing frames")

    def tracing(self) -> None:
        if self._page:
            self._page.open(screen=self._screen)
        self._screen.count("rendering", self._total, "image", timed=True)

    def expected(self, seconds: float | None) -> None:
        self._screen.expect(seconds)

    def warned(self, warnings: tuple[str, ...]) -> None:
        if self._strict:
            refuse_warnings(self._job.file or self._job.name, warnings)
        self._screen.say(warning_lines(warnings))

    def allotted(self, target: "Target") -> None:
        self._screen.say(target_lines(target))

    def written(self, images: int) -> None:
        self._screen.advance(images)

    def starting_workers(self) -> None:
        self._screen.wait("starting workers")

    def awaiting_workers(self, address: str | None) -> None:
        self._screen.say([f"waiting for workers of {address or 'this machine'}"])

    def chunked(self, workers: int, chunks: "Chunks") -> None:
        self._screen.say([f"{workers_text(workers)}, {chunks_line(chunks)}"])
        self._screen.count("rendering", self._total, "image", timed=True)

    def ambient_known(self, figures: "AmbientFigures") -> None:
        self._screen.say(ambient_lines(figures))
        self.printed = figures.notes

    def target_known(self, target: "Target") -> None:
        self._screen.say(target_lines(target))

    def compiling(self) -> None:
        self._screen.say(["workers compile kernels for their machines"])

    def compiled(self, kernels: int, seconds: float) -> None:
        self._screen.report_compiled(kernels, seconds)


LITTLE_SPACE = 64 * 1024 * 1024  # bytes; with less, a full disk is the likely cause of an error
FEW_FILES = 100  # fewer than a run has open, and leaves free when it fails


def add_space(error: OutputError, folder: Path) -> None:
    """Add to an error how little space is left on the disk that could not be written to."""
    from framearray_cli.array.folder import free_files, free_space

    with suppress(OSError):  # that disk may have gone
        if (free := free_space(folder)) < LITTLE_SPACE:
            error.add_note(f"{size(free)} are free on that disk")
        if (files := free_files(folder)) is not None and files < FEW_FILES:
            error.add_note(f"that disk takes {counted(files, 'more file')} (inodes)")
