"""`framearray sheet`."""

from typing import Annotated

import typer

from framearray_cli.base.errors import JobError
from framearray_cli.base.files import require_new
from framearray_cli.base.units import counted

from ..options import (
    ArrayFolder,
    At,
    Cameras,
    Environment,
    Exposure,
    Force,
    Json,
    Light,
    Quiet,
    Rotate,
    Soft,
    output_path,
    sum_options,
    whole,
)
from ..screen import Screen, err, print_result

MOST_WIDTH = 20_000  # pixels; more is taken for a typing error

Columns = Annotated[int, typer.Option("--columns", parser=whole(1), help="Most camera positions.", metavar="N")]
Wrap = Annotated[bool, typer.Option("--wrap", help="Light positions of one camera position, line by line.")]


def sheet(
    array: ArrayFolder,
    target: Annotated[
        str,
        typer.Option(
            "--output", "-o", help="Picture: .png or .jpg; .exr, .tif: linear, no labels.", metavar="FILE"
        ),
    ],
    cameras: Cameras = None,
    light: Light = None,
    columns: Columns = 12,
    rows: Annotated[int, typer.Option("--rows", parser=whole(1), help="Most light positions.", metavar="N")] = 8,
    width: Annotated[
        int,
        typer.Option(
            "--width", parser=whole(1, MOST_WIDTH), help="Maximum width in pixels.", metavar="PIXELS"
        ),
    ] = 2400,
    exposure: Exposure = 0.0,
    side: Annotated[
        str | None,
        typer.Option(
            "--side", help="Axis from top to bottom; default: the first.", metavar="AXIS"
        ),
    ] = None,
    at: At = None,
    wrap: Wrap = False,
    sun_hours: Annotated[
        bool, typer.Option("--sun-hours", help="Hours of direct sun in false colour, a row per day of a sun study.")
    ] = False,
    environment: Environment = None,
    rotate: Rotate = None,
    soft: Soft = None,
    force: Force = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:  # fmt: skip
    """Draw a contact sheet: camera positions from left to right, light positions from top to bottom."""
    from framearray_cli.tools.contactsheet import SheetOptions, make_sheet, make_sun_sheet

    file = output_path(target)
    sums = sum_options(environment, rotate, soft)
    require_new(file, force=force)
    with Screen(err, quiet=quiet) as screen:
        progress = screen.counter("drawing", "image")
        options = SheetOptions(cameras, light, columns, rows, width, exposure, side, at or (), wrap)
        warnings: tuple[str, ...] = ()
        if sun_hours:
            _refuse_beside_hours(light=light, at=at, side=side, exposure=exposure, wrap=wrap, sums=sums.any)
            made = make_sun_sheet(array, file, options, progress=progress)
        else:
            made, warnings = make_sheet(array, file, options, sums=sums, progress=progress)
        screen.end()
        screen.say(f"warning: {warning}" for warning in warnings)
    shown = f"{counted(len(made.cameras), 'camera position')} x {counted(len(made.lights), 'light position')}"
    print_result([f"{file}: {shown}, {made.size[0]} x {made.size[1]} pixels"], made, quiet=quiet)


def _refuse_beside_hours(**options: object) -> None:
    """Refuse options that hours of sun, which count all light positions, would ignore.

    Raises:
        JobError: one is given.
    """
    if given := [name for name, value in options.items() if value]:
        name = "sums of light" if given[0] == "sums" else f"--{given[0]}"
        raise JobError("--sun-hours", [f"expected no {name} next to it, as hours are counted over all light positions"])
