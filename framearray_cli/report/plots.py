"""The door to matplotlib: a report's plots, as SVG."""

import io
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

from framearray_cli.base.files import write_bytes

from .report import Report, TrueMeasured, model_error, true_rmse
from .settings import LIGHT_REUSE, METHODS, SCRATCH

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
        "by offset": _plot_offsets,
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


def _plot_offsets(report: Report, axes: Any) -> None:
    if len(report.offsets) < 2:
        return
    at = [o.offset for o in report.offsets]
    axes.plot(at, [o.rmse for o in report.offsets], "o-", color=CYCLE[0], label="RMSE")
    axes.plot(at, [max(o.squared_bias, 0) ** 0.5 for o in report.offsets], "s-", color=CYCLE[2], label="bias")
    axes.plot(at, [o.accepted for o in report.offsets], "^--", color=CYCLE[1], label="hits accepted, share")
    axes.set(xlabel="offset of the eye in the window", ylabel="over the mean of the reference; share")
    axes.set_ylim(bottom=0)
    axes.legend(fontsize=7)
