"""`framearray export`."""

from typing import Annotated, Literal

import typer

from framearray_cli.array.places import ALL_PLACES
from framearray_cli.base.units import counted

from ..options import ArrayFolder, At, Cameras, DryRun, Exposure, Json, Light, Quiet, output_path
from ..screen import Screen, err, print_result, print_would
from ..summing import Environment, Rotate, Soft, Weights, sum_options
from ..values import choice, whole


def export(
    array: ArrayFolder,
    kind: Annotated[
        Literal["nerfstudio", "colmap", "cinema", "rti"],
        typer.Option(
            "--format", "-f", help="What the folder is for.", show_default=False,
            **choice("nerfstudio", "colmap", "cinema", "rti"),
        ),
    ],
    target: Annotated[
        str,
        typer.Option("--output", "-o", help="Folder; cinema adds .cdb.", metavar="FOLDER", show_default=False),
    ],
    cameras: Cameras = None,
    light: Light = None,
    at: At = None,
    image_format: Annotated[
        Literal["png", "jpg", "exr", "tif"],
        typer.Option("--image-format", help="Of the pictures.", **choice("png", "jpg", "exr", "tif")),
    ] = "png",
    exposure: Exposure = 0.0,
    points: Annotated[
        int, typer.Option("--points", parser=whole(0), help="Points of the scene, at most.", metavar="N")
    ] = 10_000,
    environment: Environment = None,
    rotate: Rotate = None,
    soft: Soft = None,
    weights: Weights = None,
    copy: Annotated[bool, typer.Option("--copy", help="Copy images that could be hard links.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace an earlier export.")] = False,
    dry_run: DryRun = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:  # fmt: skip
    """Export a frame array for other tools: images with cameras, lights, depth and points."""
    from framearray_cli.array.images.images import FOR_SCREENS, ImageFormat
    from framearray_cli.tools.export import export_array as run

    if exposure and image_format not in FOR_SCREENS:
        raise typer.BadParameter("changes only PNG and JPEG", param_hint="--exposure")
    with Screen(err, quiet=quiet) as screen:
        made = run(
            array, output_path(target), kind, cameras=cameras or ALL_PLACES, light=light, at=at or (),
            image_format=ImageFormat(format=image_format, exposure=exposure), points=points, copy=copy,
            sums=sum_options(environment, rotate, soft, weights),
            force=force, dry_run=dry_run, progress=screen.counter("exporting", "image"),
        )  # fmt: skip
        screen.end()
        screen.say(f"warning: {warning}" for warning in made.warnings)
    size = f"{counted(made.n_cameras, 'camera position')} x {counted(made.n_lights, 'light position')}"
    if dry_run:
        print_would([f"would {'replace' if made.replaces else 'write'} {made.target}: {size}"])
        return
    size += f", {counted(made.n_points, 'point')}" if kind in ("nerfstudio", "colmap") else ""
    from ..array_results import ExportResult

    result = ExportResult(
        directory=str(made.target), format=kind, cameras=made.n_cameras, lights=made.n_lights, points=made.n_points
    )
    print_result([f"{made.target}: {size}", *(f"note: {note}" for note in made.notes)], result, quiet=quiet)
