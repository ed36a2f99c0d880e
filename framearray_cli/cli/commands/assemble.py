"""`framearray assemble`."""

import os
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from framearray_cli.base.errors import OutputError
from framearray_cli.base.forms.toml import STDIN
from framearray_cli.base.units import LEAST_FPS, MOST_FPS, MOST_SECONDS, MOST_STOPS, counted

from ..completions import complete_axis_places, complete_job
from ..options import ArrayFolder, DryRun, Force, Json, Quiet, Strict, output_path, refuse_warnings
from ..screen import Screen, err, print_result, print_would
from ..streams import is_stdout, output_file
from ..values import number

if TYPE_CHECKING:
    from framearray_cli.tools.movie.assemble import AssembleResult as Made

    from ..array_results import AssembleResult

PathFile = Annotated[
    Path | None,
    typer.Argument(
        metavar="PATH",
        autocompletion=complete_job,
        help="Movie path, TOML; or walk, light or diagonal.",
        show_default=False,
    ),
]
Target = Annotated[
    str,
    typer.Option(
        "--output",
        "-o",
        help="Movie: .mp4, .webm, .mkv, .mov, .gif, .webp; or a sequence: frame.####.png.",
        metavar="FILE",
        show_default=False,
    ),
]
Walk = Annotated[bool, typer.Option("--walk", help="The camera moves, the light stays.")]
Light = Annotated[bool, typer.Option("--light", help="The light moves, the camera stays.")]
Diagonal = Annotated[bool, typer.Option("--diagonal", help="Both move.")]
Stay = Annotated[
    list[str] | None,
    typer.Option(
        "--at",
        help="Where the other stays: 5, last, 50%, or AXIS=PLACE; see guide/places.md. Default: first.",
        metavar="PLACE",
        autocompletion=complete_axis_places,
    ),
]
Seconds = Annotated[
    float | None,
    typer.Option(
        "--seconds",
        parser=number(0.001, MOST_SECONDS),
        help="Length of a movement; default: one frame per image.",
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
    str, typer.Option("--view", help="Look: srgb, aces, or a view of the configuration in $OCIO.", metavar="VIEW")
]
Label = Annotated[bool, typer.Option("--label", help="Write camera and light index into each picture.")]


def assemble(
    array: ArrayFolder,
    path_file: PathFile = None,
    *,
    target: Target,
    walk: Walk = False,
    light: Light = False,
    diagonal: Diagonal = False,
    at: Stay = None,
    seconds: Seconds = None,
    fps: FrameRate = None,
    blend: Blend = False,
    exposure: Stops = 0.0,
    view: View = "srgb",
    label: Label = False,
    strict: Strict = False,
    force: Force = False,
    dry_run: DryRun = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Cut a movie or an image sequence out of a frame array."""
    from framearray_cli.tools.movie.assemble import assemble_movie as run
    from framearray_cli.tools.movie.display import find_view
    from framearray_cli.tools.movie.look import Look
    from framearray_cli.tools.movie.sweep import Sweep, SweepKind

    choices: dict[SweepKind, bool] = {"walk": walk, "light": light, "diagonal": diagonal}
    kinds = [kind for kind, wanted in choices.items() if wanted or str(path_file) == kind]
    path_file = None if str(path_file) in choices else path_file  # ./walk is a file
    _refuse_conflicts(path_file, kinds, at, seconds)
    movie = _movie_file(target, force=force) if is_stdout(target) and not dry_run else nullcontext(output_path(target))
    with movie as file, Screen(err, quiet=quiet) as screen:

        def warn(warnings: Sequence[str]) -> None:
            if strict:
                refuse_warnings(path_file or array, warnings)
            screen.say([f"warning: {warning}" for warning in warnings])

        made = run(
            array,
            path_file or Sweep(kind=kinds[0], at=tuple(at or ()), seconds=seconds),
            file,
            look=Look(exposure=exposure, view=find_view(view), label=label),
            fps=fps,
            positions="blend" if blend else None,
            progress=screen.counter("assembling", "frame"),
            warned=warn,
            force=force,
            dry_run=dry_run,
        )
    rate = f"{float(made.fps):g} frames per second"
    size = f"{counted(made.n_frames, 'frame')} from {counted(made.n_images, 'image')}"
    if dry_run:
        there = os.path.isfile(target)
        print_would([f"would {'replace' if there else 'write'} {target}: {size}, {rate}"])
        return
    print_result([f"{made.target}: {size}, {rate}"], _typed(made), quiet=quiet or is_stdout(target))


def _typed(made: "Made") -> "AssembleResult":
    """Return the result for `--json`."""
    from ..array_results import AssembleResult

    return AssembleResult(path=str(made.target), frames=made.n_frames, images=made.n_images, fps=float(made.fps))


def _movie_file(target: str, *, force: bool) -> AbstractContextManager[Path]:
    """Return the file of a movie for standard output, which must say its format."""
    from framearray_cli.tools.movie.assemble import MOVIES

    if Path(target).suffix.lower() not in MOVIES:
        wanted = ", ".join(f"-{suffix}" for suffix in MOVIES)
        raise OutputError(f"{target}: expected {wanted}, the format of a movie on standard output")
    return output_file(Path(target), "", force=force)


def _refuse_conflicts(
    path_file: Path | None, kinds: Sequence[str], at: Sequence[str] | None, seconds: float | None
) -> None:
    """Refuse options that do not go together."""
    ways = ([f"the path file {path_file}"] if path_file else []) + [f"--{kind}" for kind in kinds]
    if len(ways) != 1:
        found = " and ".join(ways) or "none of them"
        raise typer.BadParameter(f"expected a path file, --walk, --light or --diagonal; got {found}", param_hint="PATH")
    no_file = path_file and not path_file.suffix and len(path_file.parts) == 1 and not os.path.exists(path_file)
    if no_file and path_file != STDIN:
        found = f"got {path_file}, and there is no such file"
        raise typer.BadParameter(f"expected a path file, walk, light or diagonal; {found}", param_hint="PATH")
    if path_file and seconds is not None:
        raise typer.BadParameter("a path file gives the lengths of its segments", param_hint="--seconds")
    if at and kinds in ([], ["diagonal"]):
        raise typer.BadParameter("needs --walk or --light, where the other stays", param_hint="--at")
