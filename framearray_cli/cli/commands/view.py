"""`framearray view`."""

from typing import TYPE_CHECKING, Annotated

import typer

from framearray_cli.base.memory import available_cores
from framearray_cli.base.platform import Stopped, set_alarm
from framearray_cli.base.threads import sleep_until_stopped
from framearray_cli.base.units import size

from ..live import LOOPBACK, prepare_pictures, refuse_page, warning_lines
from ..options import ArrayFolder, Browser, Force, Host, Json, Port, Quiet, ThreadsOfNoJob, output_path
from ..screen import Screen, err, print_document, print_result

if TYPE_CHECKING:
    from framearray_cli.tools.view.tiles import Tiles

Target = Annotated[
    str | None, typer.Option("--export", help="Write the page as files for any web server.", metavar="FOLDER")
]
Offline = Annotated[
    bool, typer.Option("--offline", help="With --export: the page opens as a file, too; a third larger.")
]
Cache = Annotated[
    str | None, typer.Option("--cache", help="Folder for prepared pictures; default: OUT/.view.", metavar="FOLDER")
]


def view(
    array: ArrayFolder,
    target: Target = None,
    offline: Offline = False,
    port: Port = None,
    host: Host = None,
    browser: Browser = None,
    cache: Cache = None,
    threads: ThreadsOfNoJob = None,
    force: Force = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Walk through a frame array in the browser."""
    from framearray_cli.array.integrity import list_present, missing_text
    from framearray_cli.tools.view.show import open_browser, open_server, open_tiles

    from ..results import ServerResult

    if offline and target is None:
        raise typer.BadParameter("needs --export", param_hint="--offline")
    if target is not None:
        refuse_page(port, host, browser, "expected no --export next to it, which serves nothing")
    workers = threads or available_cores()
    folder = output_path(cache, "--cache") if cache is not None else None
    tiles = open_tiles(array, folder, workers)
    with Screen(err, quiet=quiet) as screen:
        if lacking := list_present(tiles.manifest).incomplete():
            then = "the page marks them" if target else "the page shows them as they come"
            screen.say([f"warning: {missing_text(lacking, tiles.manifest.n_cameras)}; {then}"])
        if target is not None:
            _export(tiles, target, workers, screen, offline=offline, force=force, quiet=quiet)
            return

        try:
            with open_server(tiles, port or 0, host or LOOPBACK, workers) as server:
                shows = ServerResult(url=server.url, pictures=tiles.n_pictures)
                print_result([f"{server.url}  Ctrl-C ends"], shows)
                print_document("view")  # at once: whoever asked for it waits for the address
                if browser is not False:
                    open_browser(server.url)
                prepared = f"all pictures that are there are prepared, in {tiles.folder}"
                prepare_pictures(tiles, workers, screen, prepared)
                sleep_until_stopped()
        except Stopped:  # how a user ends it
            set_alarm(0.0)


def _export(
    tiles: "Tiles", target: str, threads: int, screen: Screen, *, offline: bool, force: bool, quiet: bool
) -> None:
    """Write the page as files, and print what was written."""
    from framearray_cli.tools.view.show import write_page

    from ..results import PageResult

    folder = output_path(target, "--export")
    screen.count("preparing", tiles.n_pictures, "picture")
    n_bytes, problems = write_page(
        tiles, folder, threads=threads, progress=screen.advance, force=force, offline=offline
    )
    screen.say(warning_lines(problems))
    screen.end()
    page = PageResult(directory=target, size_bytes=n_bytes, pictures=tiles.n_pictures, damaged=len(problems))
    how = "open its index.html" if offline else "any web server can show it"
    print_result([f"{target}: the page, {size(n_bytes)}; {how}"], page, quiet=quiet)
