"""A report's files: one HTML page, its plots and pictures, and tables: TOML for programs, CSV for spreadsheets."""

import csv
import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import tomli_w

from framearray_cli import __version__
from framearray_cli.array.images import write_codes
from framearray_cli.base.arrays import Bytes, Float32
from framearray_cli.base.colour import srgb8_from_linear
from framearray_cli.base.files import whole_file, write_bytes

from .measure import Measured
from .settings import LIGHT_REUSE, METHODS, SCRATCH, Settings
from .survey import (
    Advice,
    Report,
    TrueLight,
    TrueMeasured,
    model_error,
    times_faster,
    true_rmse,
    truth_of,
)
from .truth import PATHS

COLUMNS = (
    "name", "n_r", "weights", "hits", "obscurance", "indirect",
    "one_light", "ms", "rmse", "relmse", "mean_off", "bias", "noise", "squared_bias",
    "squared_bias_error", "flicker_camera", "flicker_light", "accepted_hits", "accepted_hits_1st_percentile",
    "times_faster_than_scratch", "on_the_front",
)  # fmt: skip


def table_row(one: Measured, report: Report) -> dict[str, Any]:
    """Return one row of the tables, without values that were not measured."""
    values = {
        "name": one.named.name,
        **asdict(one.named.settings),
        **asdict(one.quality),
        "ms": one.ms,
        "bias": one.quality.bias,
        "noise": one.quality.noise,
        "accepted_hits": one.hits[0],
        "accepted_hits_1st_percentile": one.hits[1],
        "times_faster_than_scratch": times_faster(one, report.measured),
        "on_the_front": one in report.front,
    }
    return {name: values[name] for name in COLUMNS if values[name] is not None}


def report_table(report: Report) -> dict[str, Any]:
    """Return all figures of a report, as table.toml has them."""
    table: dict[str, Any] = {
        "job": report.job.name,
        "cameras": [c for frames in report.probes.cameras for c in frames],
        "lights": list(report.probes.lights),
        "reference": {"hits": report.reference_hits, "rmse": report.reference_noise},
        "settings": [table_row(one, report) for one in report.measured],
        "advice": [_advice_table(one, one.best.quality.rmse if one.best else None, report) for one in report.advice],
    }
    return table | ({"truth": _truth_table(report.true_light, report)} if report.true_light else {})


def write_tables(report: Report) -> None:
    """Write table.csv, truth.csv and table.toml into the report's folder.

    Raises:
        OutputError: they cannot be written.
    """
    table = report_table(report)
    _write_csv(report.folder / "table.csv", table["settings"], COLUMNS)
    if report.true_light is not None:
        true_rows = table["truth"]["settings"]
        _write_csv(report.folder / "truth.csv", true_rows, tuple(true_rows[0]))
    with whole_file(report.folder / "table.toml") as part:
        part.write_bytes(tomli_w.dumps(table).encode())


def _write_csv(file: Path, rows: Sequence[Mapping[str, Any]], columns: Sequence[str]) -> None:
    with whole_file(file) as part, part.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, columns, restval="")
        writer.writeheader()
        writer.writerows(rows)


def _truth_table(true_light: TrueLight, report: Report) -> dict[str, Any]:
    """Return what is known with respect to true light."""
    return {
        "cameras": list(true_light.cameras),
        "lights": list(true_light.lights),
        "reference": {"hits": true_light.hits, "rmse": true_light.noise},
        "settings": [_true_row(one, true_light) for one in true_light.measured],
        "advice": [
            _advice_table(one, truth_of(one.best).rmse if one.best else None, report) for one in true_light.advice
        ],
    }


def _true_row(one: TrueMeasured, true_light: TrueLight) -> dict[str, Any]:
    error = truth_of(one)
    return {
        "name": one.named.name,
        **asdict(one.named.settings),
        "ms": one.ms,
        "rmse": error.rmse,
        "rmse_error": error.rmse_error,
        "rmse_of_squares": error.coarse,
        "mean_off": error.mean_off,
        "on_the_front": one in true_light.front,
    }


def _advice_table(one: Advice[Any], rmse: float | None, report: Report) -> dict[str, Any]:
    found: dict[str, Any] = {"error": one.error}
    if one.best:
        lines: Sequence[str] = one.best.named.settings.lines(Settings.of(report.job))
        found |= {"settings": one.best.named.name, "ms": one.best.ms, "rmse": rmse}
        found["lines"] = list(lines)
    return found


CROP = 96  # pixels per side
ENLARGEMENT = 3  # times
# Brightness of a picture: this percentile of its brightest channel is shown as white.
WHITE = 98.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """One picture of the page: its file and caption."""

    file: str
    caption: str


def draw_crops(report: Report) -> list[Picture]:
    """Write crops of the reference, of the job's own settings, and of the baselines closest to them in time.

    The crop is the part of the image where the job's own error is most visible.
    """
    top, left = _worst_crop(np.abs(report.signed))
    own = report.measured[0]
    shown: list[tuple[str, Float32]] = [("reference", report.example), (_caption(own), own.example)]
    for family in (LIGHT_REUSE, SCRATCH):
        of_family = [m for m in report.measured if m.named.family == family]
        if of_family:
            near = min(of_family, key=lambda m: abs(np.log(m.ms / own.ms)))
            shown.append((_caption(near), near.example))
    scale = _white_scale(report.example)
    found = []
    for i, (caption, image) in enumerate(shown):
        part = image[top : top + CROP, left : left + CROP]
        codes = srgb8_from_linear(scale * part).repeat(ENLARGEMENT, axis=0).repeat(ENLARGEMENT, axis=1)
        found.append(_write_picture(report, f"crop-{i}.png", codes, caption))
    return found


def draw_maps(report: Report) -> list[Picture]:
    """Write the reference, the job's own image, and a map of its error."""
    own, scale = report.measured[0], _white_scale(report.example)
    found = [
        _write_picture(report, "reference.png", srgb8_from_linear(scale * report.example), "reference"),
        _write_picture(report, "own.png", srgb8_from_linear(scale * own.example), _caption(own)),
    ]
    caption = "image less reference: red too bright, blue too dark; full colour at half the mean of the reference"
    return [*found, _write_picture(report, "signed.png", _signed_map(report.signed), caption)]


def _write_picture(report: Report, name: str, codes: Bytes, caption: str) -> Picture:
    write_codes(report.folder / name, codes)
    return Picture(file=name, caption=caption)


def _caption(one: Measured) -> str:
    return f"{one.named.name}: {one.ms:.3g} ms, RMSE {one.quality.rmse:.1%}"


def _worst_crop(error: Float32) -> tuple[int, int]:
    """Return the top left corner of the crop whose mean error is largest, on a grid of half crops."""
    h, w = error.shape
    tops, lefts = (range(0, max(side - CROP, 0) + 1, CROP // 2) for side in (h, w))
    return max(
        ((top, left) for top in tops for left in lefts),
        key=lambda corner: float(error[corner[0] : corner[0] + CROP, corner[1] : corner[1] + CROP].mean()),
    )


def _white_scale(image: Float32) -> float:
    white = float(np.percentile(image.max(axis=-1), WHITE))
    return 1.0 / white if white > 0 else 1.0


def _signed_map(values: Float32) -> Bytes:
    """Map values below 0 to blue, 0 to white, above 0 to red; full colour from one half on."""
    share = np.clip(values / 0.5, -1, 1)[..., None]
    red, blue = np.array([0.78, 0.1, 0.1]), np.array([0.1, 0.25, 0.8])
    colour = 1 - np.abs(share) * (1 - np.where(share > 0, red, blue))
    return np.asarray(255 * colour + 0.5, np.uint8)


COLOURS = {
    "job": "#c53030", LIGHT_REUSE: "#718096", SCRATCH: "#1a202c",
    "obscurance": "#975a16", "cells": "#00b5d8",
}  # fmt: skip
# A method is a line of its own; other lines start at the job's settings.
WHOLE_LINES = (LIGHT_REUSE, SCRATCH, *METHODS)
_Point = TypeVar("_Point", bound=TrueMeasured)
CYCLE = ("#2b6cb0", "#2f855a", "#b7791f", "#6b46c1", "#0987a0", "#b83280", "#9c4221", "#4a5568")


def draw_plots(report: Report) -> dict[str, str]:
    """Draw every plot into the report's folder; return title -> file name.

    Raises:
        OutputError: one cannot be written.
    """
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams.update({"svg.hashsalt": "framearray", "svg.fonttype": "none", "font.size": 9})
    plots: dict[str, Callable[[Report, Any], None]] = {
        "true light and time": _plot_true_light,
        "error and time": _plot_error_and_time,
        "bias and noise": _plot_bias_and_noise,
        "flicker": _plot_flicker,
    }
    found = {}
    for title, draw in plots.items():
        name = f"{title.replace(' ', '-')}.svg"
        if _draw(report.folder / name, draw, report):
            found[title] = name
    return found


def _draw(file: Path, draw: Callable[[Report, Any], None], report: Report) -> bool:
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(7.4, 4.4), layout="constrained")
    try:
        draw(report, axes)
        if not axes.has_data():
            return False
        axes.grid(alpha=0.3, which="both")
        drawn = io.BytesIO()
        figure.savefig(drawn, format="svg", metadata={"Date": None, "Creator": None})
        write_bytes(file, drawn.getvalue())
    finally:
        pyplot.close(figure)
    return True


def _families(measured: Sequence[_Point]) -> dict[str, list[_Point]]:
    """Return the points that a line joins, by family; a family that varies one setting starts at the job's own."""
    families: dict[str, list[_Point]] = {}
    for one in measured[1:]:
        start = [] if one.named.family in WHOLE_LINES else [measured[0]]
        families.setdefault(one.named.family, start).append(one)
    return families


def _colour(family: str, i: int) -> str:
    return COLOURS.get(family, CYCLE[i % len(CYCLE)])


def _plot_true_light(report: Report, axes: Any) -> None:
    if report.true_light is None:
        return
    _plot_error(axes, report.true_light.measured, report.true_light.front, true_rmse)
    axes.set_ylabel("RMSE with respect to true light, over its mean")


def _plot_error_and_time(report: Report, axes: Any) -> None:
    _plot_error(axes, report.measured, report.front, model_error)
    axes.set_ylabel("RMSE over the mean of the reference")


def _plot_error(
    axes: Any, measured: Sequence[_Point], front: Sequence[_Point], error_of: Callable[[_Point], float]
) -> None:
    """Draw error against time: a line per family, the best front, and a star at the job's own settings."""
    for i, (family, points) in enumerate(_families(measured).items()):
        points = sorted(points, key=lambda m: m.ms)
        label = f'indirect.method = "{family}"' if family in METHODS else family
        axes.plot(
            [m.ms for m in points], [error_of(m) for m in points], "s-" if family in METHODS else "o-",
            color=_colour(family, i), label=label, markersize=4, linewidth=1, alpha=0.8,
        )  # fmt: skip
    axes.plot(
        [m.ms for m in front], [error_of(m) for m in front], "-", color="#f6ad55", linewidth=5, alpha=0.5, zorder=0,
        label="best front",
    )  # fmt: skip
    own = measured[0]
    axes.plot([own.ms], [error_of(own)], "*", color=COLOURS["job"], markersize=13, label="as the job says")
    axes.set(xscale="log", yscale="log", xlabel="ms per image")
    axes.legend(fontsize=7, ncols=2)


def _bars(axes: Any, names: list[str], series: dict[str, list[float]], label: str) -> None:
    """Draw horizontal bars, one group per name."""
    height = 0.8 / len(series)
    for i, (name, values) in enumerate(series.items()):
        places = [k + (i - (len(series) - 1) / 2) * height for k in range(len(names))]
        axes.barh(places, values, height=height, color=CYCLE[i], label=name)
    axes.set_yticks(range(len(names)), names, fontsize=7)
    axes.invert_yaxis()
    axes.set_xlabel(label)
    axes.legend(fontsize=7)


def _plot_bias_and_noise(report: Report, axes: Any) -> None:
    shown = [m for m in report.measured if not m.named.settings.one_light]
    series = {"bias": [m.quality.bias for m in shown], "noise": [m.quality.noise for m in shown]}
    _bars(axes, [m.named.name for m in shown], series, "over the mean of the reference")


def _plot_flicker(report: Report, axes: Any) -> None:
    shown = [m for m in report.measured if not m.named.settings.one_light]
    series = {}
    for name, key in (("along the camera path", "flicker_camera"), ("along the light path", "flicker_light")):
        values = [getattr(m.quality, key) for m in shown]
        if all(value is not None for value in values):
            series[name] = values
    if series:
        _bars(axes, [m.named.name for m in shown], series, "relMSE of what changes from image to image")


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
