"""`render --view`: the page of an array opens while it is rendered."""

from collections.abc import Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING, Self

from framearray_cli.base.errors import OutputError
from framearray_cli.base.memory import available_cores
from framearray_cli.base.platform import Stopped, set_alarm, stopped_by
from framearray_cli.base.threads import sleep_until_stopped
from framearray_cli.base.units import agree, counted

from .document import outcome
from .options import refuse
from .screen import Screen, err, print_document, print_result, say

if TYPE_CHECKING:
    from framearray_cli.array.manifest import Manifest
    from framearray_cli.job.job import Job
    from framearray_cli.tools.view.server import PageServer
    from framearray_cli.tools.view.tiles import Tiles

LOOPBACK = "127.0.0.1"
MOST_PROBLEMS = 5  # named one by one


def refuse_page(port: int | None, host: str | None, browser: bool | None, problem: str) -> None:
    """Refuse options of the page where it is not served."""
    named = {"--port": port, "--host": host, "--browser" if browser else "--no-browser": browser}
    refuse({option: value is not None for option, value in named.items()}, problem)


class LivePage:
    """The page of an array that this process renders; open from the first coarse pictures on, until Ctrl-C."""

    def __init__(self, job: "Job", port: int | None, host: str | None, *, browser: bool, quiet: bool) -> None:
        refuse({"--host": host == ""}, "expected an address, got none")
        self._job, self._port, self._host = job, port or 0, host or LOOPBACK
        self._browser, self._quiet = browser, quiet
        self._stack = ExitStack()
        self._server: PageServer | None = None
        self._done = False

    def open(self, manifest: "Manifest | None" = None, screen: Screen | None = None) -> "PageServer":
        """Open the page, unless it is open already; return its server.

        Args:
            manifest: of the array; None: that in its folder.
            screen: that shows something now.
        """
        if self._server is not None:
            return self._server
        from framearray_cli.array.manifest_toml import read_manifest
        from framearray_cli.tools.view.show import open_browser, open_server, open_tiles

        array = manifest or read_manifest(self._job.output.directory)
        tiles = open_tiles(array, None, 1)  # few threads: the others render
        self._server = self._stack.enter_context(open_server(tiles, self._port, self._host))
        line = f"{self._server.url}  shows the array; Ctrl-C ends"
        if outcome.wanted:
            say(err, [line])
        elif screen is not None:
            screen.show([line])
        else:
            print_result([line], outcome.result)
        if self._browser:
            open_browser(self._server.url)
        return self._server

    def stay(self) -> None:
        """Show the finished array until Ctrl-C."""
        self._done = True
        print_document("render")
        try:
            server, threads = self.open(), self._job.render.threads or available_cores()
            with Screen(err, quiet=self._quiet) as screen:
                done = "all pictures of the page are prepared; Ctrl-C ends"
                prepare_pictures(server.settle(), threads, screen, done)
            sleep_until_stopped()
        except Stopped:  # how a user ends it
            set_alarm(0.0)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        self._stack.close()
        if error is not None and not self._done and self._server is not None and stopped_by(error):
            error.add_note(f"`framearray view {self._job.output.directory}` shows what is there")


def prepare_pictures(tiles: "Tiles", threads: int, screen: Screen, prepared: str) -> None:
    """Prepare all pictures that are there; `prepared`: a line for the end."""
    from framearray_cli.tools.view.show import prepare_all

    screen.done = 0
    screen.count("preparing", tiles.n_pictures, "picture")
    problems = prepare_all(tiles, threads, screen.advance)
    screen.end()
    screen.say([*warning_lines(problems), prepared])


def warning_lines(problems: Sequence[OutputError]) -> list[str]:
    """Word the errors of damaged images, the first ones by name."""
    rest = len(problems) - MOST_PROBLEMS
    more = [f"warning: {counted(rest, 'more image')} {agree(rest, 'is', 'are')} damaged"] if rest > 0 else []
    return [*(f"warning: {problem}" for problem in problems[:MOST_PROBLEMS]), *more]
