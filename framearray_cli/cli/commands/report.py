"""`framearray report`."""

from typing import TYPE_CHECKING, Annotated

from framearray_cli.array.places import CAMERA_AXIS, read_indices
from framearray_cli.render.messages import scene_lines

from .. import options as opt
from ..screen import Screen, err, print_result

if TYPE_CHECKING:
    from framearray_cli.report.case import Case
    from framearray_cli.report.survey import Comparison, Report

FOLDER = "Folder of the report; default: next to the images."
VARY = "Values of a setting to try, and of no other: samples.hits=1,2,4; may be repeated."
Truth = Annotated[bool, opt.option("--truth/--no-truth", "Compare with true light and other methods; default.")]


def report(
    job_file: opt.JobFile,
    target: Annotated[str | None, opt.option("--output -o", FOLDER, "FOLDER")] = None,
    cameras: opt.Cameras = None,
    light: opt.Light = None,
    vary: Annotated[list[str] | None, opt.option("--vary", VARY, "KEY=VALUES")] = None,
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

        chosen = _indices("--cameras", cameras, job.camera.frames)
        lights = _indices("--light", light, job.light.frames, MAIN_AXIS)
        values = dict(reporting.read_vary(option, job) for option in vary or ())
        beside = job.output.directory.with_name(f"{job.output.directory.name}-report")
        with screen.compiling():
            made = reporting.make_report(
                job, folder.absolute() if folder else beside, cameras=chosen, lights=lights, vary=values, truth=truth,
                planned=planned, done=screen.advance,
            )  # fmt: skip
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
    """Sum up a report: the job's own settings, and the best front."""
    own, to_what = made.measured[0], " with respect to true light"
    best: Comparison = made.true_light or made
    true_error = f", {own.truth.rmse:.1%}{to_what}" if made.true_light and own.truth else ""
    return [
        f"as the job says: {own.ms:.3g} ms per image before writing, RMSE {own.quality.rmse:.1%}{true_error}",
        *([] if made.true_light else [made.without_truth]),
        f"no other settings beat these in both time and error{to_what if made.true_light else ''}:",
        *(f"  {one.ms:.3g} ms per image, RMSE {best.rmse(one):.1%}: {one.named.name}" for one in best.front),
        f"report: {made.folder / 'index.html'}",
    ]
