"""`framearray render --preview`."""

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import TYPE_CHECKING, cast

import typer

from framearray_cli.array.moments import moment_text, read_times
from framearray_cli.array.places import MIDDLE_PLACE, read_axes, read_indices
from framearray_cli.base.errors import JobError, OutputError

from ..options import is_stdout, output_file, output_path
from ..screen import Screen, err, print_result

if TYPE_CHECKING:
    from framearray_cli.array.images import Extension
    from framearray_cli.job.job import Job


def preview_on_screen(
    job: "Job",
    target: str | None,
    *,
    cameras: str | None,
    light: str | None,
    at: Sequence[str],
    force: bool,
    quiet: bool,
) -> None:
    """Render one small picture into a file of its own."""
    from framearray_cli.array.images import FOR_SCREENS, ImageFormat, format_name, require_writer, write_image
    from framearray_cli.render.messages import scene_lines
    from framearray_cli.render.precompile import FLOATS, offer_for
    from framearray_cli.render.preview import light_axes, render_preview

    folder = job.output.directory
    file = folder.with_name(f"{folder.name}-preview.png") if target is None else output_path(target)
    name = format_name(file) or ("png" if is_stdout(str(file)) else "")
    if name not in ("png", "jpg", "exr", "tif"):
        raise OutputError(f"{file}: expected a .png, .jpg, .exr or .tif for the picture of --preview")
    image_format = cast("Extension", name)
    require_writer(image_format)
    c = _one("--cameras", MIDDLE_PLACE if cameras is None else cameras, job.camera.frames, "camera")
    axes = light_axes(job)
    given = read_axes("--at", at, axes, {group.name: group.axis for group in job.light.groups})
    if light is not None:
        first = next(iter(axes))
        if first in given:
            raise JobError("--light", [f"expected either this or {given[first][0]}=..., got both"])
        given[first] = ("--light", light)
    wanted = {axis: given.get(axis, (f"--at {axis}", MIDDLE_PLACE)) for axis in axes}
    moments = job.light.moments
    places = {
        axis: _one(option, text, axes[axis], axis, moments.get(axis, ())) for axis, (option, text) in wanted.items()
    }
    with output_file(file, ".png", force=force or target is None) as part, Screen(err, quiet=quiet) as screen:
        screen.wait("rendering a preview")
        offer_for(job, FLOATS)
        with screen.compiling():
            made = render_preview(job, c, places)
        screen.say(scene_lines(made.prepared))
        exposure = job.output.exposure if name in FOR_SCREENS else 0.0
        write_image(part, made.image, ImageFormat(format=image_format, exposure=exposure))
    if not is_stdout(str(file)):
        (height, width, _), full = made.image.shape, job.camera.resolution
        shown = ", ".join([f"camera {c}", *(f"{axis} {l}{_when(moments, axis, l)}" for axis, l in places.items())])
        lines = [f"{file}: {shown}, {width} x {height} of {full[0]} x {full[1]} pixels"]
        from ..results import PreviewResult

        result = PreviewResult(preview=str(file), camera=c, lights=dict(places), size=(width, height))
        print_result(lines, result, quiet=quiet)


def _when(moments: Mapping[str, Sequence[datetime]], axis: str, l: int) -> str:
    """Word date and time of a light position, if it has some."""
    return f", {moment_text(moments[axis][l])}" if axis in moments else ""


def _one(option: str, text: str, n: int, axis: str, moments: Sequence[datetime] = ()) -> int:
    """Read one place."""
    found = read_indices(option, read_times(option, text, lambda: moments), n, axis)
    if len(found) > 1:
        raise JobError(option, [f"expected one place for the picture of --preview, got {len(found)}"])
    return found[0]


def refuse_conflicts(preview: bool, others: Mapping[str, object], needs_preview: Mapping[str, object]) -> None:
    """Refuse options that do not go together with --preview, or only with it.

    Args:
        others, needs_preview: values by option; empty ones were not given.
    """
    for option, value in (others if preview else needs_preview).items():
        if value:
            problem = "does not go with --preview" if preview else "needs --preview"
            raise typer.BadParameter(problem, param_hint=option)
