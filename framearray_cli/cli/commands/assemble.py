"""`framearray assemble`."""

import os
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from framearray_cli.array.moments import without_times
from framearray_cli.array.places import is_notation
from framearray_cli.base.errors import OutputError
from framearray_cli.base.forms.toml import STDIN
from framearray_cli.base.units import LEAST_FPS, MOST_FPS, MOST_SECONDS, MOST_STOPS, counted

from ..completions import complete_axis_places, complete_job, complete_light_places, complete_places
from ..help import Command
from ..options import ArrayFolder, DryRun, Force, Json, Quiet, Strict, output_path, refuse_warnings
from ..screen import Screen, err, print_result, print_would
from ..streams import is_stdout, output_file
from ..summing import Environment, Rotate, Soft, Weights, sum_options
from ..values import number

if TYPE_CHECKING:
    from framearray_cli.tools.movie.assemble import AssembleResult as Made

PathFile = Annotated[
    Path | None,
    typer.Argument(
        metavar="PATH",
        autocompletion=complete_job,
        help="Movie path, TOML; or walk, light or diagonal: what moves from first to last.",
        show_default=False,
    ),
]
Target = Annotated[
    str,
    typer.Option(
        "--output",
        "-o",
        help="Movie: .mp4, .webm, .mkv, .mov, .gif, .webp, .avif; or a sequence: frame.####.png.",
        metavar="FILE",
        show_default=False,
    ),
]
# Spellings of earlier versions: `walk`, `light` and `diagonal` in the place of a path file mean the same.
Walk = Annotated[bool, typer.Option("--walk", help="As walk in place of PATH.", hidden=True)]
Diagonal = Annotated[bool, typer.Option("--diagonal", help="As diagonal in place of PATH.", hidden=True)]
Cameras = Annotated[
    str | None,
    typer.Option(
        "--cameras",
        help="Where the camera stays, or what it passes: 5, 0-47x3, last-0; see reference/places.md.",
        autocompletion=complete_places,
        metavar="PLACES",
    ),
]
Light = Annotated[
    str | None,
    typer.Option(
        "--light",
        help="The same of the light.",
        autocompletion=complete_light_places,
        metavar="PLACES",
    ),
]
Stay = Annotated[
    list[str] | None,
    typer.Option(
        "--at",
        help="The same of another light axis: lamps=0-3; may be repeated.",
        metavar="AXIS=PLACES",
        autocompletion=complete_axis_places,
    ),
]
MOVEMENTS = ("walk", "light", "diagonal")
LIGHT_MOVES = "light"  # what `--light` without places stands for, as in earlier versions
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
    str, typer.Option("--view", help="Look: srgb, aces, or a view of the configuration in $OCIO.", metavar="VIEW")
]
Otio = Annotated[bool, typer.Option("--otio", help="Describe a sequence for editing programs, in a file beside it.")]
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
    at: Stay = None,
    walk: Walk = False,
    diagonal: Diagonal = False,
    seconds: Seconds = None,
    fps: FrameRate = None,
    blend: Blend = False,
    environment: Environment = None,
    rotate: Rotate = None,
    soft: Soft = None,
    weights: Weights = None,
    exposure: Stops = 0.0,
    view: View = "srgb",
    label: Label = False,
    otio: Otio = False,
    layers: Layered = False,
    strict: Strict = False,
    force: Force = False,
    dry_run: DryRun = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Cut a movie or an image sequence out of a frame array."""
    from framearray_cli.tools.display import find_view
    from framearray_cli.tools.movie.assemble import assemble_movie as run
    from framearray_cli.tools.movie.look import Look
    from framearray_cli.tools.movie.sweep import Sweep, SweepKind

    choices: dict[SweepKind, bool] = {"walk": walk, "light": light == LIGHT_MOVES, "diagonal": diagonal}
    kinds = [kind for kind, wanted in choices.items() if wanted or str(path_file) == kind]
    path_file = None if str(path_file) in choices else path_file  # ./walk is a file
    light = None if light == LIGHT_MOVES else light
    named = [option for option, text in (("--cameras", cameras), ("--light", light)) if text is not None]
    sums = sum_options(environment, rotate, soft, weights, moves=True)
    _refuse_conflicts(path_file, kinds, named, at or (), seconds, turns=sums.turns)
    kind = kinds[0] if kinds else None
    sweep = Sweep(kind=kind, cameras=cameras, light=light, at=tuple(at or ()), seconds=seconds, turns=sums.turns)
    movie = _movie_file(target, force=force) if is_stdout(target) and not dry_run else nullcontext(output_path(target))
    with movie as file, Screen(err, quiet=quiet) as screen:

        def warn(warnings: Sequence[str]) -> None:
            if strict:
                refuse_warnings(path_file or array, warnings)
            screen.say([f"warning: {warning}" for warning in warnings])

        made = run(
            array,
            path_file or sweep, file,
            look=Look(exposure=exposure, view=find_view(view), label=label),
            fps=fps, positions="blend" if blend else None, sums=sums,
            progress=screen.counter("assembling", "frame"),
            warned=warn, force=force, dry_run=dry_run, otio=otio, layered=layers,
        )  # fmt: skip
    _print_made(made, target, dry_run=dry_run, quiet=quiet)


def _print_made(made: "Made", target: str, *, dry_run: bool, quiet: bool) -> None:
    """Print what was written, or would be."""
    from ..array_results import AssembleResult

    size = f"{counted(made.n_frames, 'frame')} from {counted(made.n_images, 'image')}"
    size += f", {float(made.fps):g} frames per second"
    if dry_run:
        texts = {target: f": {size}"} | ({str(made.otio): ""} if made.otio else {})
        print_would([f"would {'replace' if os.path.isfile(file) else 'write'} {file}{texts[file]}" for file in texts])
        return
    otio = str(made.otio) if made.otio else None
    result = AssembleResult(
        path=str(made.target), frames=made.n_frames, images=made.n_images, fps=float(made.fps), otio=otio
    )
    described = f"; {otio} describes it" if otio else ""
    print_result([f"{made.target}: {size}{described}"], result, quiet=quiet or is_stdout(target))


def _movie_file(target: str, *, force: bool) -> AbstractContextManager[Path]:
    """Return the file of a movie for standard output, which must say its format."""
    from framearray_cli.tools.movie.assemble import MOVIES

    if Path(target).suffix.lower() not in MOVIES:
        wanted = ", ".join(f"-{suffix}" for suffix in MOVIES)
        raise OutputError(f"{target}: expected {wanted}, the format of a movie on standard output")
    return output_file(Path(target), "", force=force)


def _refuse_conflicts(
    path_file: Path | None,
    kinds: Sequence[str],
    named: Sequence[str],
    at: Sequence[str],
    seconds: float | None,
    *,
    turns: bool,
) -> None:
    """Refuse options that do not go together.

    Args:
        named: options that name places.
        turns: an environment turns.
    """
    ways = ([f"the path file {path_file}"] if path_file else []) + list(kinds)
    axes = any("=" in text for text in at)
    if len(ways) > 1 or not (ways or named or axes or turns):
        found = " and ".join(ways) or "none of them"
        wanted = "a path file, walk, light or diagonal, or --cameras and --light with places"
        raise typer.BadParameter(f"expected {wanted}; got {found}", param_hint="PATH")
    no_file = path_file and not path_file.suffix and len(path_file.parts) == 1 and not os.path.exists(path_file)
    if no_file and path_file != STDIN:
        found = f"got {path_file}, and there is no such file"
        raise typer.BadParameter(f"expected a path file, walk, light or diagonal; {found}", param_hint="PATH")
    if path_file and seconds is not None:
        raise typer.BadParameter("a path file gives the lengths of its segments", param_hint="--seconds")
    if path_file and (named or at):
        option = [*named, "--at"][0]
        raise typer.BadParameter("a path file says where camera and light are", param_hint=option)
    if any("=" not in text for text in at) and kinds in ([], ["diagonal"]):
        raise typer.BadParameter("expected AXIS=PLACES; a place without an axis needs walk or light", param_hint="--at")


class AssembleCommand(Command):
    """`assemble`, which also reads `--light` without places: it was a switch in earlier versions."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        words = list(args)
        end = words.index("--") if "--" in words else len(words)
        for k, word in enumerate(words[:end]):
            if word == "--light" and not _are_places(words[k + 1] if k + 1 < end else ""):
                words[k] = f"--light={LIGHT_MOVES}"
        return super().parse_args(ctx, words)


def _are_places(word: str) -> bool:
    """Return whether the word behind `--light` belongs to it: neither an option nor an argument."""
    return is_notation(without_times(word)) or not (
        not word or word.startswith("-") or word in MOVEMENTS or word.endswith(".toml") or os.path.exists(word)
    )
