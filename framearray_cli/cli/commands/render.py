"""`framearray render`."""

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from datetime import datetime
from typing import TYPE_CHECKING, Annotated, cast

from framearray_cli.array.places import MIDDLE_PLACE, read_indices
from framearray_cli.base.errors import JobError, OutputError
from framearray_cli.base.files import require_new
from framearray_cli.base.sundays import moment_text
from framearray_cli.base.units import MOST_THREADS, agree, counted
from framearray_cli.render.messages import summary_lines

from .. import options as opt
from ..live import LivePage, refuse_page
from ..screen import Screen, err, print_result

if TYPE_CHECKING:
    from framearray_cli.array.images import Extension
    from framearray_cli.job.job import Job
    from framearray_cli.render.events import RenderResult
    from framearray_cli.render.parts.run import WorkerOptions


PREVIEW = "Render one small picture within seconds, next to the folder; --cameras and --light select it."
SHOW = "Show the array in the browser while it is rendered; coarse pictures first."
PROCESSES = "Processes that render parts in parallel."
DASK = "Dask scheduler whose workers render: tcp://host:8786."
CHUNK = "Most camera positions per part; with --workers or --dask."


def render(
    job_file: opt.JobFile,
    threads: opt.Threads = None,
    output: opt.Output = None,
    sets: opt.Sets = None,
    folders: opt.Folders = None,
    cameras: opt.Cameras = None,
    preview: Annotated[bool, opt.option("--preview", PREVIEW)] = False,
    light: opt.Light = None,
    at: opt.At = None,
    workers: Annotated[int | None, opt.option("--workers", PROCESSES, "N", opt.whole(1, MOST_THREADS))] = None,
    dask: Annotated[str | None, opt.option("--dask", DASK, "ADDRESS")] = None,
    chunk: Annotated[int | None, opt.option("--chunk", CHUNK, "N", opt.whole(1))] = None,
    strict: opt.Strict = False,
    restart: Annotated[bool, opt.option("--restart", "Remove the frame array in the folder first.")] = False,
    force: Annotated[bool, opt.option("--force", "With --preview: replace an existing picture.")] = False,
    view: Annotated[bool, opt.option("--view", SHOW)] = False,
    port: opt.Port = None,
    host: opt.Host = None,
    browser: opt.Browser = None,
    quiet: opt.Quiet = False,
    json: opt.Json = False,
) -> None:
    """Render every image of a job into a folder, with a manifest; skip those that are there."""
    if preview:
        others = {"--workers": workers, "--dask": dask is not None, "--chunk": chunk, "--restart": restart}
        opt.refuse(others | {"--strict": strict, "--view": view}, "does not go with --preview")
    else:
        opt.refuse({"--light": light is not None, "--at": at, "--force": force}, "needs --preview")
    opt.require_rendering(job_file, sets or ())
    if not view:
        refuse_page(port, host, browser, "needs --view")
    job = opt.load_job(job_file, threads, None if preview else output, sets, folders)
    if preview:
        _preview_on_screen(job, output, cameras=cameras, light=light, at=at or (), force=force, quiet=quiet)
        return
    chosen = None if cameras is None else sorted(read_indices("--cameras", cameras, job.camera.frames))
    options = _worker_options(workers, dask, chunk)
    page = LivePage(job, port, host, browser=browser is not False, quiet=quiet) if view else nullcontext()
    with page as live:
        render_on_screen(job, quiet=quiet, strict=strict, restart=restart, cameras=chosen, options=options, page=live)
        if live:
            live.stay()


def _worker_options(workers: int | None, dask: str | None, chunk: int | None) -> "WorkerOptions | None":
    """Return the options of the workers that render; None: this process renders."""
    opt.refuse({"--workers": workers and dask is not None}, "expected either --workers or --dask")
    if not workers and dask is None:
        opt.refuse({"--chunk": chunk}, "needs --workers or --dask")
        return None
    # usually an unset shell variable
    opt.refuse({"--dask": dask is not None and not dask.strip()}, "expected an address, got none")
    from framearray_cli.render.parts.run import WorkerOptions

    return WorkerOptions(workers=workers or 1, address=dask, chunk=chunk)


def render_on_screen(
    job: "Job",
    *,
    quiet: bool,
    strict: bool = False,
    restart: bool = False,
    cameras: Sequence[int] | None = None,
    options: "WorkerOptions | None" = None,
    repairs: bool = False,
    page: LivePage | None = None,
) -> "RenderResult":
    """Render, show the progress on the screen, and print the summary; return the result.

    Args:
        repairs: whether damaged files were listed already.
        page: opens as soon as there is something to show.
    """
    with Screen(err, quiet=quiet) as screen:
        screen.wait("reading the scene")
        # first: in the other order Python takes and returns memory thousands of times while numba loads, for 0.13 s
        from framearray_cli.render.render import render as run  # isort: skip
        from framearray_cli.render.precompile import offer_for

        from ..rendering import RenderPrinter, add_space

        offer_for(job)
        printer = RenderPrinter(screen, repairs=repairs, page=page)
        try:
            with screen.compiling():
                coarse = page is not None
                if options is None:
                    summary = run(job, printer.report, restart=restart, cameras=cameras, coarse=coarse, strict=strict)
                else:
                    from framearray_cli.render.parts.run import render_in_parts

                    summary = render_in_parts(
                        job, options, printer.report, restart=restart, cameras=cameras, coarse=coarse, strict=strict
                    )
        except BaseException as error:
            if isinstance(error, OutputError):
                add_space(error, job.output.directory)
            if screen.done:
                done = f"{screen.done:,} of {counted(screen.total, 'image')} {agree(screen.done, 'was', 'were')}"
                error.add_note(f"{done} written to {job.output.directory}; the same command goes on with the rest")
            raise
    result = summary.result(screen.compile_seconds)
    print_result(summary_lines(summary, printer.printed, job, screen.compile_seconds), result, quiet=quiet)
    return result


def _preview_on_screen(
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
    from framearray_cli.array.images import FOR_SCREENS, ImageFormat, format_name, write_image
    from framearray_cli.render.messages import scene_lines
    from framearray_cli.render.precompile import FLOATS, offer_for
    from framearray_cli.render.preview import light_axes, render_preview
    from framearray_cli.tools.axes import named_places

    folder = job.output.directory
    file = folder.with_name(f"{folder.name}-preview.png") if target is None else opt.output_path(target)
    name = format_name(file)
    if name not in ("png", "jpg", "exr", "tif"):
        raise OutputError(f"{file}: expected a .png, .jpg, .exr or .tif for the picture of --preview")
    image_format = cast("Extension", name)
    c = _one("--cameras", MIDDLE_PLACE if cameras is None else cameras, job.camera.frames, "camera")
    axes = light_axes(job)
    moments, groups = job.light.moments, {group.name: group.axis for group in job.light.groups}
    given = named_places(axes, groups, light, at)
    places = {axis: _one(*given.get(axis, (f"--at {axis}", MIDDLE_PLACE)), n, axis) for axis, n in axes.items()}
    require_new(file, force=force or target is None)
    with Screen(err, quiet=quiet) as screen:
        screen.wait("rendering a preview")
        offer_for(job, FLOATS)
        with screen.compiling():
            image, prepared = render_preview(job, c, places)
        screen.say(scene_lines(prepared))
        exposure = job.output.exposure if name in FOR_SCREENS else 0.0
        write_image(file, image, ImageFormat(format=image_format, exposure=exposure))
    (height, width, _), full = image.shape, job.camera.resolution
    shown = ", ".join([f"camera {c}", *(f"{axis} {l}{_when(moments, axis, l)}" for axis, l in places.items())])
    lines = [f"{file}: {shown}, {width} x {height} of {full[0]} x {full[1]} pixels"]
    from ..results import PreviewResult

    result = PreviewResult(preview=str(file), camera=c, lights=dict(places), size=(width, height))
    print_result(lines, result, quiet=quiet)


def _when(moments: Mapping[str, Sequence[datetime]], axis: str, l: int) -> str:
    """Word date and time of a light position, if it has some."""
    return f", {moment_text(moments[axis][l])}" if axis in moments else ""


def _one(option: str, text: str, n: int, axis: str) -> int:
    """Read one place."""
    found = read_indices(option, text, n, axis)
    if len(found) > 1:
        raise JobError(option, [f"expected one place for the picture of --preview, got {len(found)}"])
    return found[0]
