"""`framearray still`."""

import re
from typing import Annotated

from framearray_cli.base.errors import JobError
from framearray_cli.base.forms.words import shown

from .. import options as opt
from ..screen import Screen, err, print_result

EYE = "Camera position: 5, 50%, last; see reference/conventions.md."
LIT = "Light position, or the one nearest to a date and time: 5, 50%, 2026-06-21T12:00."
AXIS = "Position along another light axis: lamps=3; may be repeated."


def still(
    array: opt.ArrayFolder,
    *,
    target: Annotated[str, opt.option("--output -o", "Picture: .png, .jpg; .exr, .tif: linear.", "FILE")],
    camera: Annotated[str | None, opt.option("--camera", EYE, "PLACE")] = None,
    light: Annotated[str | None, opt.option("--light", LIT, "PLACE")] = None,
    at: Annotated[list[str] | None, opt.option("--at", AXIS, "AXIS=PLACE")] = None,
    blend: opt.Blend = False,
    environment: opt.Environment = None,
    rotate: opt.Rotate = None,
    soft: opt.Soft = None,
    size: Annotated[str | None, opt.option("--size", "Resize to these pixels.", "WxH")] = None,
    exposure: opt.Stops = 0.0,
    view: opt.View = "srgb",
    label: opt.Label = False,
    text: opt.Text = "",
    layers: opt.Layers = False,
    force: opt.Force = False,
    quiet: opt.Quiet = False,
    json: opt.Json = False,
) -> None:
    """Make a picture of one place in a frame array."""
    from framearray_cli.base.views import find_view
    from framearray_cli.tools.movie.look import Look
    from framearray_cli.tools.movie.movie import MovieOptions, assemble_movie
    from framearray_cli.tools.movie.pathfile import Sweep

    opt.refuse({"--layers": layers and size}, "identifiers and depths cannot be resized; expected no --size next to it")
    sums, file = opt.sum_options(environment, rotate, soft), opt.output_path(target)
    options = MovieOptions(
        look=Look(exposure=exposure, view=find_view(view), label=label or bool(text), text=text, size=_read_size(size)),
        positions="blend" if blend else None, sums=sums, layered=layers,
    )  # fmt: skip
    sweep = Sweep(cameras=camera, light=light, at=tuple(at or ()), still=True)
    with Screen(err, quiet=quiet) as screen:
        made = assemble_movie(
            array, sweep, file, options, force=force, note=lambda text: screen.say([f"note: {text}"]),
            warned=lambda warnings: screen.say([f"warning: {warning}" for warning in warnings]),
        )  # fmt: skip
    print_result([f"{made.path}: {made.size[0]} x {made.size[1]} pixels"], made, quiet=quiet)


def _read_size(text: str | None) -> tuple[int, int] | None:
    """Read "1920x1080"."""
    found = re.fullmatch(r"([1-9]\d{0,4})x([1-9]\d{0,4})", text or "", re.ASCII)
    if text is not None and not (found and max(map(int, found.groups())) <= 16384):
        raise JobError("--size", [f"expected WxH such as 1920x1080, at most 16384 each, got {shown(text)}"])
    return (int(found[1]), int(found[2])) if found else None
