"""A report as one HTML page, beside its plots and pictures."""

from collections.abc import Sequence
from importlib.resources import files

from framearray_cli import __version__
from framearray_cli.base.files import whole_file

from .crops import draw_crops, draw_maps
from .front import times_faster
from .plots import draw_plots
from .run import Report
from .settings import Settings
from .tables import write_tables
from .true_light import TrueMeasured
from .truth import PATHS


def write_report(report: Report) -> None:
    """Write tables, plots, pictures and the page into the report's folder.

    Raises:
        OutputError: something cannot be written.
    """
    import jinja2

    write_tables(report)
    true_light = report.true_light
    environment = jinja2.Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    environment.filters.update(percent=_format_percent, number=_format_number)
    template = environment.from_string((files(__package__) / "page.html").read_text(encoding="utf-8"))
    text = template.render(
        report=report,
        version=__version__,
        plots=draw_plots(report),
        crops=draw_crops(report),
        maps=draw_maps(report),
        rows=[(one, times_faster(one, report.measured), one in report.front) for one in report.measured],
        advice=[(one, advice_lines(one.best, report)) for one in report.advice],
        true_advice=[(one, advice_lines(one.best, report)) for one in true_light.advice] if true_light else [],
        paths=PATHS,
        cameras=[c for frames in report.probes.cameras for c in frames],
    )
    with whole_file(report.folder / "index.html") as part:
        part.write_text(text, encoding="utf-8")


def advice_lines(best: TrueMeasured | None, report: Report) -> Sequence[str]:
    """Return the lines to paste into the job to get some settings; a comment where there are none."""
    if best is None:
        return ["# no tested settings reach it"]
    return best.named.settings.lines(Settings.of(report.job)) or ["# as the job is"]


def _format_percent(value: float) -> str:
    return f"{100 * value:.3g} %"


def _format_number(value: float | None) -> str:
    return "" if value is None else f"{value:.3g}"
