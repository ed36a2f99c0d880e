"""`framearray export`."""

from typing import Annotated, Literal

import typer

from framearray_cli.array.places import ALL_PLACES
from framearray_cli.base.units import counted
from framearray_cli.tools.export import EXPORT_KINDS

from ..options import (
    ArrayFolder,
    At,
    Cameras,
    Environment,
    Exposure,
    Json,
    Light,
    Quiet,
    Rotate,
    Soft,
    choice,
    output_path,
    sum_options,
    whole,
)
from ..screen import Screen, err, print_result

Kind = Annotated[
    str,
    typer.Option(
        "--format", "-f", help=f"Purpose: {', '.join(EXPORT_KINDS[:-1])} or {EXPORT_KINDS[-1]}.",
        **choice(*EXPORT_KINDS)
    ),
]  # fmt: skip
Target = Annotated[
    str,
    typer.Option("--output", "-o", help="Folder of the export.", metavar="FOLDER"),
]
Group = Annotated[
    str | None,
    typer.Option("--group", help="Only the light of this group of sources.", metavar="NAME"),
]
Split = Annotated[
    list[str] | None,
    typer.Option(
        "--split",
        help="Sets: 80/10/10 (train/val/test), light=90/10, test=0-lastx8; may be repeated; see guide/export.md.",
        metavar="RULE",
    ),
]
Seed = Annotated[int, typer.Option("--split-seed", parser=whole(0), help="Random seed for --split.", metavar="N")]
PicturesFormat = Annotated[
    Literal["png", "jpg", "exr", "tif"],
    typer.Option("--image-format", help="Format of the pictures.", **choice("png", "jpg", "exr", "tif")),
]
Points = Annotated[
    int, typer.Option("--points", parser=whole(0), help="Maximum number of points of the scene.", metavar="N")
]


def export(
    array: ArrayFolder,
    kind: Kind,
    target: Target,
    cameras: Cameras = None,
    light: Light = None,
    at: At = None,
    group: Group = None,
    split: Split = None,
    seed: Seed = 0,
    image_format: PicturesFormat = "png",
    exposure: Exposure = 0.0,
    points: Points = 10_000,
    environment: Environment = None,
    rotate: Rotate = None,
    soft: Soft = None,
    copy: Annotated[bool, typer.Option("--copy", help="Copy images that could be hard links.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace an earlier export.")] = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Export a frame array for other tools: images with cameras, lights, depth and points."""
    from framearray_cli.array.images import FOR_SCREENS, ImageFormat
    from framearray_cli.tools.export.write import ExportOptions, export_array

    if exposure and image_format not in FOR_SCREENS:
        raise typer.BadParameter("changes only PNG and JPEG", param_hint="--exposure")
    with Screen(err, quiet=quiet) as screen:
        options = ExportOptions(
            kind=kind, cameras=cameras or ALL_PLACES, light=light, at=at or (), group=group,
            image_format=ImageFormat(format=image_format, exposure=exposure), points=points,
            sums=sum_options(environment, rotate, soft), copy=copy, split=tuple(split or ()), seed=seed,
        )  # fmt: skip
        progress = screen.counter("exporting", "image")
        made, notes, warnings = export_array(array, output_path(target), options, force=force, progress=progress)
        screen.end()
        screen.say(f"warning: {warning}" for warning in warnings)
    size = f"{counted(made.cameras, 'camera position')} x {counted(made.lights, 'light position')}"
    if made.sets:
        size += f", {', '.join(f'{n:,} {name}' for name, n in made.sets.items())}"
    size += f", {counted(made.points, 'point')}" if made.points else ""
    print_result([f"{made.directory}: {size}", *(f"note: {note}" for note in notes)], made, quiet=quiet)
