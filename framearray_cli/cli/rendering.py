"""Lines that `render` and `check` print while they work."""

from contextlib import suppress
from pathlib import Path

from framearray_cli.base.errors import OutputError
from framearray_cli.base.units import counted, size
from framearray_cli.render import events
from framearray_cli.render.messages import (
    ambient_lines,
    chunks_line,
    on_disk_lines,
    target_lines,
)

from .live import LivePage
from .screen import Screen


def event_lines(event: events.Event, *, damaged: bool = True) -> list[str]:
    """Describe an event of a render, with damaged files if wanted; nothing of one that only moves a display."""
    match event:
        case events.Noted():
            return [event.line]
        case events.Warned():
            return [f"warning: {event.text}"]
        case events.Scanned():
            return on_disk_lines(event, damaged=damaged)
        case events.AmbientEstimated():
            return ambient_lines(event)
        case events.HitsAllotted():
            return target_lines(event.target)
        case events.ChunksBegun():
            return [f"{counted(event.workers, 'worker')}, {chunks_line(event.chunks)}"]
        case events.Compiling():
            return ["workers compile kernels for their machines"]
    return []


class RenderPrinter:
    """Print the events of a render: the scene, then the ambient light, then a progress bar.

    Attributes:
        printed: notes that were printed.
    """

    def __init__(self, screen: Screen, *, repairs: bool = False, page: LivePage | None = None) -> None:
        self._screen, self._repairs, self._page = screen, repairs, page
        self._total = 0
        self.printed: tuple[str, ...] = ()

    def report(self, event: events.Event) -> None:
        """Print an event; any thread may call."""
        screen = self._screen
        match event:
            case events.Working():
                screen.wait(event.text)
            case events.TimeLeft():
                screen.expect(event.seconds)
            case events.ImagesWritten():
                screen.advance(event.images)
            case events.KernelsLoaded():
                screen.compiled()
            case events.Compiled():
                screen.report_compiled(event.kernels, event.seconds)
            case events.CoarseBegun() if self._page:
                self._page.open(event.array, screen)
            case events.FramesBegun():
                if self._page:
                    self._page.open(screen=screen)
                screen.count("rendering", self._total, "image", timed=True)
            case _:
                screen.say(event_lines(event, damaged=not self._repairs))
        match event:
            case events.Scanned():
                self._total = event.wanted
            case events.AmbientEstimated():
                self.printed = event.notes
            case events.ChunksBegun():
                screen.count("rendering", self._total, "image", timed=True)


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
