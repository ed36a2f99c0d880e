"""`framearray assemble`."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, get_args

import typer

from framearray_cli.base.errors import JobError
from framearray_cli.base.forms.toml import STDIN
from framearray_cli.base.units import LEAST_FPS, MOST_FPS, MOST_SECONDS, MOST_STOPS, counted

from ..options import (
    ArrayFolder,
    At,
    Environment,
    Force,
    Json,
    Light,
    Quiet,
    Rotate,
    Soft,
    Strict,
    number,
    output_path,
    sum_options,
)
from ..screen import Screen, err, print_result

PathFile = Annotated[
    Path | None,
    typer.Argument(
        metavar="PATH",
        help="Movie path, TOML; or walk, light or diagonal: a movement from first to last.",
    ),
]
Target = Annotated[
    str,
    typer.Option(
        "--output",
        "-o",
        help="Movie: .mp4, .webm, .mkv, .mov, .gif, .webp, .avif; or a sequence: frame.####.png.",
        metavar="FILE",
    ),
]
Cameras = Annotated[
    str | None,
    typer.Option(
        "--cameras",
        help="Camera positions, one or several to pass: 5, 0-47x3, last-0; see reference/conventions.md.",
        metavar="PLACES",
    ),
]
Seconds = Annotated[
    float | None,
    typer.Option(
        "--seconds",
        parser=number(0.001, MOST_SECONDS),
        help="Length of the movement; default: one frame per image.",
        metavar="S",
    ),
]
FrameRate = Annotated[
    float | None, typer.Option("--fps", parser=number(LEAST_FPS, MOST_FPS), help="Frames per second.", metavar="RATE")
]
Blend = Annotated[bool, typer.Option("--blend", help="Blend between light positions.")]
Stops = Annotated[
    float,
    typer.Option(
        "--exposure",
        parser=number(-MOST_STOPS, MOST_STOPS),
        help="Stops added to movies, PNG and JPEG.",
        metavar="STOPS",
    ),
]
View = Annotated[
    str, typer.Option("--view", help="View: srgb, aces, or a view of the configuration in $OCIO.", metavar="VIEW")
]
Layered = Annotated[
    bool, typer.Option("--layers", help="EXR with the light of each group and the array's layers in every file.")
]
Label = Annotated[bool, typer.Option("--label", help="Write camera and light index into each picture.")]


def assemble(
    array: ArrayFolder,
    path_file: PathFile = None,
    *,
    target: Target,
    cameras: Cameras = None,
    light: Light = None,
    at: At = None,
    seconds: Seconds = None,
    fps: FrameRate = None,
    blend: Blend = False,
    environment: Environment = None,
    rotate: Rotate = None,
    soft: Soft = None,
    exposure: Stops = 0.0,
    view: View = "srgb",
    label: Label = False,
    layers: Layered = False,
    strict: Strict = False,
    force: Force = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Cut a movie or an image sequence out of a frame array."""
    from framearray_cli.tools.movie.look import Look, find_view
    from framearray_cli.tools.movie.movie import MovieOptions, assemble_movie
    from framearray_cli.tools.movie.pathfile import Sweep, SweepKind

    kind = next((kind for kind in get_args(SweepKind) if str(path_file) == kind), None)  # ./walk is a file
    path_file = None if kind else path_file
    given = {"--cameras": cameras, "--light": light, "--at": at}
    named = [option for option, places in given.items() if places]
    sums = sum_options(environment, rotate, soft, moves=True)
    if path_file:
        _check_path_file(path_file, named, seconds)
    elif not (kind or named or sums.turns):
        wanted = "a path file, walk, light or diagonal, or --cameras and --light with places"
        raise typer.BadParameter(f"expected {wanted}; got none of them", param_hint="PATH")
    sweep = Sweep(kind=kind, cameras=cameras, light=light, at=tuple(at or ()), seconds=seconds, turns=sums.turns)
    file = output_path(target)
    with Screen(err, quiet=quiet) as screen:

        def warn(warnings: Sequence[str]) -> None:
            if strict and warnings:
                raise JobError(path_file or array, warnings)
            screen.say([f"warning: {warning}" for warning in warnings])

        options = MovieOptions(
            look=Look(exposure=exposure, view=find_view(view), label=label), fps=fps,
            positions="blend" if blend else None, sums=sums, layered=layers,
        )  # fmt: skip
        progress = screen.counter("assembling", "frame")
        made = assemble_movie(array, path_file or sweep, file, options, progress=progress, warned=warn, force=force)
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
    if seconds is not None:
        raise typer.BadParameter("a path file gives the lengths of its segments", param_hint="--seconds")
    if named:
        raise typer.BadParameter("a path file says where camera and light are", param_hint=named[0])
