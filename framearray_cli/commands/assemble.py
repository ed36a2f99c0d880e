"""`framearray assemble`."""

from pathlib import Path
from typing import Annotated

import typer

from ..errors import JobError
from ..screen import Screen, out, say
from .options import Quiet, fail, place, problems


def assemble(
    array: Annotated[Path, typer.Argument(metavar="OUT", help="Folder that `render` wrote.", show_default=False)],
    path_file: Annotated[Path, typer.Argument(metavar="PATH", help="Movie path, TOML.", show_default=False)],
    target: Annotated[
        str,
        typer.Option(
            "--output",
            "-o",
            help="movie.mp4 (.mov, .mkv, .webm) or a sequence: frame.####.png",
            metavar="FILE",
            show_default=False,
        ),
    ],
    exposure: Annotated[
        float,
        typer.Option("--exposure", min=-64, max=64, help="Stops added to movies, PNG and JPEG.", metavar="STOPS"),
    ] = 0.0,
    quiet: Quiet = False,
) -> None:
    """Cut a movie or an image sequence out of a frame array."""
    from ..assemble import assemble as run

    with Screen(out, quiet=quiet) as screen:

        def progress(done: int, total: int) -> None:
            if not screen.total:
                screen.count("assembling", total, "frame")
            screen.advance()

        try:
            result = run(array, path_file, place(target), exposure=exposure, progress=progress)
        except JobError as error:
            fail(problems(error, "nothing was written"), error.exit_code)
    if not quiet:
        rate = f"{float(result.fps):g} frames a second"
        say(out, [f"{result.target}: {result.n_frames} frames from {result.n_images} images, {rate}"])
