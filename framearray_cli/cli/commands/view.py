"""`framearray view`."""

from typing import TYPE_CHECKING, Annotated

import typer

from framearray_cli.base.memory import available_cores
from framearray_cli.base.platform import Stopped, set_alarm
from framearray_cli.base.threads import sleep_until_stopped
from framearray_cli.base.units import size

from .. import options as opt
from ..live import LOOPBACK, prepare_pictures, refuse_page, warning_lines
from ..screen import Screen, err, print_document, print_result

if TYPE_CHECKING:
    from framearray_cli.tools.view.tiles import Tiles

PAGE = "Write the page as a folder or a ZIP for any web server."
MOST = "With --export: bytes at most, such as 300MB; chooses quality and size."
Cache = Annotated[str | None, opt.option("--cache", "Folder for prepared pictures; default: OUT/.view.", "FOLDER")]


def view(
    array: opt.ArrayFolder,
    target: Annotated[str | None, opt.option("--export", PAGE, "FOLDER|ZIP")] = None,
    most: Annotated[str | None, opt.option("--most", MOST, "SIZE")] = None,
    port: opt.Port = None,
    host: opt.Host = None,
    browser: opt.Browser = None,
    cache: Cache = None,
    threads: opt.ThreadsOfNoJob = None,
    force: opt.Force = False,
    quiet: opt.Quiet = False,
    json: opt.Json = False,
) -> None:
    """Walk through a frame array in the browser."""
    from framearray_cli.array.integrity import list_present, missing_text
    from framearray_cli.tools.view.show import open_browser, open_server, open_tiles

    from ..results import ServerResult

    opt.refuse({"--most": most is not None and target is None}, "needs --export")
    opt.refuse({"--host": host == ""}, "expected an address, got none")
    if target is not None:
        refuse_page(port, host, browser, "expected no --export next to it, which serves nothing")
    workers = threads or available_cores()
    folder = opt.output_path(cache, "--cache") if cache is not None else None
    tiles = open_tiles(array, folder, workers)
    with Screen(err, quiet=quiet) as screen:
        if lacking := list_present(tiles.manifest).incomplete():
            then = "the page marks them" if target else "the page shows them as they come"
            screen.say([f"warning: {missing_text(lacking, tiles.manifest.n_cameras)}; {then}"])
        if target is not None:
            _export(tiles, target, most, workers, screen, force=force, quiet=quiet)
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
    tiles: "Tiles", target: str, most: str | None, threads: int, screen: Screen, *, force: bool, quiet: bool
) -> None:
    """Write the page as files, and print what was written."""
    from framearray_cli.base.extras import install_command
    from framearray_cli.tools.movie.video import require_av, require_encoder
    from framearray_cli.tools.view.clips import Clips, can_encode
    from framearray_cli.tools.view.pagefiles import bytes_for_tiles, is_zip, write_page

    from ..results import PageResult

    folder = opt.output_path(target, "--export")
    if most is not None:
        require_av("--most needs PyAV")
        require_encoder(".webm")
        tiles.fit_clips(bytes_for_tiles(folder, _bytes(most)))
    elif can_encode():
        tiles.clips = Clips()
    else:
        install = install_command("[movie]")
        screen.say([f"note: every picture is a JPEG; with PyAV the export is a tenth as large: {install}"])
    screen.count("preparing", tiles.n_pictures, "picture")
    n_bytes, problems = write_page(tiles, folder, threads=threads, progress=screen.advance, force=force)
    screen.say(warning_lines(problems))
    screen.end()
    page = PageResult(directory=target, size_bytes=n_bytes, pictures=tiles.n_pictures, damaged=len(problems))
    how = "unpack it, and open index.html" if is_zip(folder) else "open its index.html"
    print_result([f"{target}: the page, {size(n_bytes)}; {how}"], page, quiet=quiet)


def _bytes(text: str) -> int:
    """Read a number of bytes with its unit."""
    from pydantic import ByteSize, TypeAdapter, ValidationError

    try:
        return TypeAdapter(ByteSize).validate_python(text)
    except ValidationError as error:
        raise typer.BadParameter(f'expected a size such as 300MB, got "{text}"', param_hint="--most") from error
