"""`framearray assemble`."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, get_args

import typer

from framearray_cli.base.errors import JobError
from framearray_cli.base.forms.toml import STDIN
from framearray_cli.base.units import LEAST_FPS, MOST_FPS, MOST_SECONDS, counted

from .. import options as opt
from ..screen import Screen, err, print_result

PATH = "Movie path, TOML; or walk, light or diagonal: a movement from first to last."
MOVIE = "Movie: .mp4, .webm, .mkv, .mov, .gif, .webp, .avif; or a sequence: frame.####.png."
EYES = "Camera positions, one or several to pass: 5, 0-47x3, last-0; see reference/conventions.md."
LENGTH = "Length of the movement; default: one frame per image."
RATES = opt.number(LEAST_FPS, MOST_FPS)


def assemble(
    array: opt.ArrayFolder,
    path_file: Annotated[Path | None, typer.Argument(metavar="PATH", help=PATH)] = None,
    *,
    target: Annotated[str, opt.option("--output -o", MOVIE, "FILE")],
    cameras: Annotated[str | None, opt.option("--cameras", EYES, "PLACES")] = None,
    light: opt.Light = None,
    at: opt.At = None,
    seconds: Annotated[float | None, opt.option("--seconds", LENGTH, "S", opt.number(0.001, MOST_SECONDS))] = None,
    fps: Annotated[float | None, opt.option("--fps", "Frames per second.", "RATE", RATES)] = None,
    blend: opt.Blend = False,
    environment: opt.Environment = None,
    rotate: opt.Rotate = None,
    soft: opt.Soft = None,
    exposure: opt.Stops = 0.0,
    view: opt.View = "srgb",
    label: opt.Label = False,
    text: opt.Text = "",
    layers: opt.Layers = False,
    strict: opt.Strict = False,
    force: opt.Force = False,
    quiet: opt.Quiet = False,
    json: opt.Json = False,
) -> None:
    """Cut a movie or an image sequence out of a frame array."""
    from framearray_cli.base.views import find_view
    from framearray_cli.tools.movie.look import Look
    from framearray_cli.tools.movie.movie import MovieOptions, assemble_movie
    from framearray_cli.tools.movie.pathfile import Sweep, SweepKind

    kind = next((kind for kind in get_args(SweepKind) if str(path_file) == kind), None)  # ./walk is a file
    path_file = None if kind else path_file
    given = {"--cameras": cameras, "--light": light, "--at": at or None}
    named = [option for option, places in given.items() if places is not None]
    sums = opt.sum_options(environment, rotate, soft, moves=True)
    if path_file:
        _check_path_file(path_file, named, seconds)
    elif not (kind or named or sums.turns):
        wanted = "a path file, walk, light or diagonal, or --cameras and --light with places"
        raise typer.BadParameter(f"expected {wanted}; got none of them", param_hint="PATH")
    sweep = Sweep(kind=kind, cameras=cameras, light=light, at=tuple(at or ()), seconds=seconds, turns=sums.turns)
    file = opt.output_path(target)
    with Screen(err, quiet=quiet) as screen:

        def warn(warnings: Sequence[str]) -> None:
            if strict and warnings:
                raise JobError(path_file or array, warnings)
            screen.say([f"warning: {warning}" for warning in warnings])

        options = MovieOptions(
            look=Look(exposure=exposure, view=find_view(view), label=label or bool(text), text=text), fps=fps,
            positions="blend" if blend else None, sums=sums, layered=layers,
        )  # fmt: skip
        progress = screen.counter("assembling", "frame")
        made = assemble_movie(
            array, path_file or sweep, file, options, force=force,
            progress=progress, warned=warn, note=lambda text: screen.say([f"note: {text}"]),
        )  # fmt: skip
    size = f"{counted(made.frames, 'frame')} from {counted(made.images, 'image')}"
    print_result([f"{made.path}: {size}, {made.fps:g} frames per second"], made, quiet=quiet)


def _check_path_file(path_file: Path, named: Sequence[str], seconds: float | None) -> None:
    """Refuse a path file that is a misspelt movement, and options that do not go with one.

    Args:
        named: options that name places.
    """
    no_file = not path_file.suffix and len(path_file.parts) == 1 and not os.path.exists(path_file)
    if no_file and path_file != STDIN:
        found = f"got {path_file}, and there is no such file"
        raise typer.BadParameter(f"expected a path file, walk, light or diagonal; {found}", param_hint="PATH")
    opt.refuse({"--seconds": seconds is not None}, "a path file gives the lengths of its segments")
    opt.refuse(dict.fromkeys(named, True), "a path file says where camera and light are")
