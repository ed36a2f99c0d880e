"""`framearray report`."""

from typing import TYPE_CHECKING, Annotated

from framearray_cli.array.places import CAMERA_AXIS, read_indices
from framearray_cli.render.messages import scene_lines

from .. import options as opt
from ..screen import Screen, err, print_result

if TYPE_CHECKING:
    from framearray_cli.report.case import Case
    from framearray_cli.report.measure import Measured, MeasuredMethod
    from framearray_cli.report.survey import Advice, Report

FOLDER = "Folder of the report; default: next to the images."
VARY = "Values of a setting to try: samples.hits=1,2,4; may be repeated."
ERROR = "Target error, RMSE: find the cheapest settings for it: 0.05; may be repeated."
TIMES = "Samples of a reference over samples of a picture."
Truth = Annotated[bool, opt.option("--truth/--no-truth", "Compare with true light and other methods; default.")]


def report(
    job_file: opt.JobFile,
    target: Annotated[str | None, opt.option("--output -o", FOLDER, "FOLDER")] = None,
    cameras: opt.Cameras = None,
    light: opt.Light = None,
    vary: Annotated[list[str] | None, opt.option("--vary", VARY, "KEY=VALUES")] = None,
    only: Annotated[bool, opt.option("--only", "Change only the keys of --vary.")] = False,
    error: Annotated[list[float] | None, opt.option("--error", ERROR, "E", opt.number(1e-6))] = None,
    times: Annotated[float, opt.option("--times", TIMES, "N", opt.number(1))] = 100.0,
    truth: Truth = True,
    threads: opt.Threads = None,
    quiet: opt.Quiet = False,
    json: opt.Json = False,
) -> None:
    """Measure the effect of each setting of a job on speed and error, as a page with tables and plots."""
    folder = None if target is None else opt.output_path(target)
    opt.require_rendering(job_file, ())
    job = opt.load_job(job_file, threads, None)
    with Screen(err, quiet=quiet) as screen:
        screen.wait("reading the scene")
        from framearray_cli import report as reporting
        from framearray_cli.array.manifest import MAIN_AXIS
        from framearray_cli.render.precompile import FLOATS, offer_for

        offer_for(job, FLOATS)

        def planned(case: "Case", steps: int) -> None:
            screen.say(scene_lines(case.prepared))
            screen.count("measuring", steps, "step")

        options = reporting.ReportOptions(
            cameras=_indices("--cameras", cameras, job.camera.frames),
            lights=_indices("--light", light, job.light.frames, MAIN_AXIS),
            vary=dict(reporting.read_vary(option, job) for option in vary or ()),
            only=only,
            errors=error or (),
            times=times,
            truth=truth,
        )
        beside = job.output.directory.with_name(f"{job.output.directory.name}-report")
        with screen.compiling():
            made = reporting.make_report(
                job,
                folder.absolute() if folder else beside,
                options,
                planned=planned,
                done=screen.advance,
            )
        reporting.write_report(made)
    from ..results import ReportResult

    result = ReportResult(
        directory=str(made.folder), page=str(made.folder / "index.html"), table=reporting.report_table(made)
    )
    print_result(report_lines(made), result, quiet=quiet)


def _indices(option: str, text: str | None, n: int, axis: str = CAMERA_AXIS) -> tuple[int, ...]:
    """Return the indices that an option names."""
    return () if text is None else read_indices(option, text, n, axis)


def report_lines(made: "Report") -> list[str]:
    """Sum up a report: the job's own settings, and the cheapest ones for some errors."""
    from framearray_cli.report import advice_lines

    own, true_light = made.measured[0], made.true_light
    true_error = f", {own.truth.rmse:.1%} with respect to true light" if true_light and own.truth else ""
    lines = [f"as the job says: {own.ms:.3g} ms per image before writing, RMSE {own.quality.rmse:.1%}{true_error}"]
    advice: list[tuple[Advice[Measured] | Advice[MeasuredMethod], str]] = [(one, "") for one in made.advice]
    if true_light:
        advice = [(one, " with respect to true light") for one in true_light.advice] + advice
    else:
        lines.append(made.without_truth)
    for one, to_what in advice:
        found = f"{one.best.named.name}, {one.best.ms:.3g} ms per image" if one.best else "nothing that was tried"
        lines.append(f"for an RMSE of {one.error:.1%}{to_what}: {found}")
        lines += [f"  {line}" for line in advice_lines(one.best, made)]
    return [*lines, f"report: {made.folder / 'index.html'}"]
