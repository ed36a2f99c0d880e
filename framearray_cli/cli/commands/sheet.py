"""`framearray sheet`."""

from typing import Annotated

from framearray_cli.base.errors import JobError
from framearray_cli.base.files import require_new
from framearray_cli.base.units import counted

from .. import options as opt
from ..screen import Screen, err, print_result

MOST_WIDTH = 20_000  # pixels; more is taken for a typing error

PICTURE = "Picture: .png or .jpg; .exr, .tif: linear, no labels."
LUX = "Illuminance in false colour, up to that many lux."
HOURS = "Hours of direct sun in false colour, a row per day of a sun study."


def sheet(
    array: opt.ArrayFolder,
    target: Annotated[str, opt.option("--output -o", PICTURE, "FILE")],
    cameras: opt.Cameras = None,
    light: opt.Light = None,
    columns: Annotated[int, opt.option("--columns", "Most camera positions.", "N", opt.whole(1))] = 12,
    rows: Annotated[int, opt.option("--rows", "Most light positions.", "N", opt.whole(1))] = 8,
    width: Annotated[int, opt.option("--width", "Maximum width in pixels.", "PIXELS", opt.whole(1, MOST_WIDTH))] = 2400,
    exposure: opt.Exposure = 0.0,
    view: opt.View = "srgb",
    side: Annotated[str | None, opt.option("--side", "Axis from top to bottom; default: the first.", "AXIS")] = None,
    at: opt.At = None,
    wrap: Annotated[bool, opt.option("--wrap", "Light positions of one camera position, line by line.")] = False,
    sun_hours: Annotated[bool, opt.option("--sun-hours", HOURS)] = False,
    lux: Annotated[float | None, opt.option("--lux", LUX, "LUX", opt.number(1e-3, 1e9))] = None,
    environment: opt.Environment = None,
    rotate: opt.Rotate = None,
    soft: opt.Soft = None,
    force: opt.Force = False,
    quiet: opt.Quiet = False,
    json: opt.Json = False,
) -> None:
    """Draw a contact sheet: camera positions from left to right, light positions from top to bottom."""
    from framearray_cli.base.views import find_view
    from framearray_cli.tools.contactsheet import SheetOptions, make_sheet, make_sun_sheet

    file = opt.output_path(target)
    sums = opt.sum_options(environment, rotate, soft)
    require_new(file, force=force)
    with Screen(err, quiet=quiet) as screen:
        progress = screen.counter("drawing", "image")
        places = cameras, light, columns, rows, width, exposure, side, at or ()
        options = SheetOptions(*places, wrap=wrap, lux=lux, view=find_view(view))
        warnings: tuple[str, ...] = ()
        if sun_hours:
            given = {"light": light is not None, "at": at, "side": side is not None, "lux": lux, "view": view != "srgb"}
            _refuse_beside_hours(**given, exposure=exposure, wrap=wrap, sums=sums.any)
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
