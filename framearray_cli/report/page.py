"""A report's files: one HTML page, its plots and pictures, and all figures as TOML."""

import io
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from framearray_cli import __version__
from framearray_cli.array.images import write_codes
from framearray_cli.base.arrays import Float32
from framearray_cli.base.colour import srgb8_from_linear
from framearray_cli.base.files import write_bytes

from .measure import Measured, MeasuredMethod
from .settings import LIGHT_REUSE, METHODS, SCRATCH
from .survey import Comparison, Report, times_faster
from .truth import PATHS


def report_table(report: Report) -> dict[str, Any]:
    """Return all figures of a report, as table.toml has them."""
    table: dict[str, Any] = {
        "job": report.job.name,
        **_comparison_table(report, [_row(one, report) for one in report.measured]),
    }
    if true_light := report.true_light:
        table["truth"] = _comparison_table(true_light, [_true_row(one) for one in true_light.measured])
    return table


def _comparison_table(made: Comparison, figures: Iterable[dict[str, Any]]) -> dict[str, Any]:
    return {
        "cameras": list(made.cameras),
        "lights": list(made.lights),
        "reference": {"hits": made.hits, "rmse": made.noise},
        "settings": [
            {
                "name": one.named.name,
                **asdict(one.named.settings),
                "ms": one.ms,
                **row,
                "on_the_front": one in made.front,
            }
            for one, row in zip(made.measured, figures, strict=True)
        ],
    }


def _row(one: Measured, report: Report) -> dict[str, Any]:
    faster = times_faster(one, report.measured)
    return {
        **asdict(one.quality),
        "bias": one.quality.bias,
        "noise": one.quality.noise,
        "accepted_hits": one.hits[0],
        "accepted_hits_1st_percentile": one.hits[1],
        **({} if faster is None else {"times_faster_than_scratch": faster}),
    }


def _true_row(one: MeasuredMethod) -> dict[str, Any]:
    assert one.truth is not None
    error = one.truth
    return {
        "rmse": error.rmse,
        "rmse_error": error.rmse_error,
        "rmse_of_squares": error.coarse,
        "mean_off": error.mean_off,
    }


CROP = 96  # pixels per side
ENLARGEMENT = 3  # times
# Brightness of a picture: this percentile of its brightest channel is shown as white.
WHITE = 98.0


def draw_crops(report: Report) -> dict[str, str]:
    """Write crops of the reference, of the job's own settings, and of the baselines closest to them in time.

    The crop is the part of the image where the job's own error is most visible.

    Returns:
        file name -> caption.
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
    for i, (_, image) in enumerate(shown):
        part = srgb8_from_linear(scale * image[top : top + CROP, left : left + CROP])
        write_codes(report.folder / f"crop-{i}.png", part.repeat(ENLARGEMENT, axis=0).repeat(ENLARGEMENT, axis=1))
    return {f"crop-{i}.png": caption for i, (caption, _) in enumerate(shown)}


def draw_maps(report: Report) -> dict[str, str]:
    """Write the reference, the job's own image, and a map of its error; return file name -> caption."""
    from matplotlib import colormaps

    own, scale = report.measured[0], _white_scale(report.example)
    write_codes(report.folder / "reference.png", srgb8_from_linear(scale * report.example))
    write_codes(report.folder / "own.png", srgb8_from_linear(scale * own.example))
    signed = np.asarray(255 * colormaps["bwr"](0.5 + report.signed)[..., :3], np.uint8)
    write_codes(report.folder / "signed.png", signed)
    caption = "image less reference: red too bright, blue too dark; full colour at half the mean of the reference"
    return {"reference.png": "reference", "own.png": _caption(own), "signed.png": caption}


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


COLOURS = {
    "job": "#c53030", LIGHT_REUSE: "#718096", SCRATCH: "#1a202c",
    "obscurance": "#975a16", "cells": "#00b5d8",
}  # fmt: skip
# A method is a line of its own; other lines start at the job's settings.
WHOLE_LINES = (LIGHT_REUSE, SCRATCH, *METHODS)
CYCLE = ("#2b6cb0", "#2f855a", "#b7791f", "#6b46c1", "#0987a0", "#b83280", "#9c4221", "#4a5568")


def draw_plots(report: Report) -> dict[str, str]:
    """Draw error against time into the report's folder, first with respect to true light; return title -> file name."""
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams.update({"svg.hashsalt": "framearray", "svg.fonttype": "none", "font.size": 9})
    found = dict[str, str]()
    if true := report.true_light:
        found["true light and time"] = "true-light-and-time.svg"
        _draw_error(report.folder / "true-light-and-time.svg", true, "RMSE with respect to true light, over its mean")
    _draw_error(report.folder / "error-and-time.svg", report, "RMSE over the mean of the reference")
    return found | {"error and time": "error-and-time.svg"}


def _families(measured: Sequence[MeasuredMethod]) -> dict[str, list[MeasuredMethod]]:
    """Return the points that a line joins, by family; a family that varies one setting starts at the job's own."""
    families: dict[str, list[MeasuredMethod]] = {}
    for one in measured[1:]:
        start = [] if one.named.family in WHOLE_LINES else [measured[0]]
        families.setdefault(one.named.family, start).append(one)
    return families


def _draw_error(file: Path, made: Comparison, label: str) -> None:
    """Draw error against time: a line per family, the best front, and a star at the job's own settings."""
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(7.4, 4.4), layout="constrained")
    for i, (family, points) in enumerate(_families(made.measured).items()):
        points = sorted(points, key=lambda m: m.ms)
        name = f'indirect.method = "{family}"' if family in METHODS else family
        axes.plot(
            [m.ms for m in points], [made.rmse(m) for m in points], "s-" if family in METHODS else "o-",
            color=COLOURS.get(family, CYCLE[i % len(CYCLE)]), label=name, markersize=4, linewidth=1, alpha=0.8,
        )  # fmt: skip
    axes.plot(
        [m.ms for m in made.front], [made.rmse(m) for m in made.front], "-",
        color="#f6ad55", linewidth=5, alpha=0.5, zorder=0, label="best front",
    )  # fmt: skip
    own = made.measured[0]
    axes.plot([own.ms], [made.rmse(own)], "*", color=COLOURS["job"], markersize=13, label="as the job says")
    axes.set(xscale="log", yscale="log", xlabel="ms per image", ylabel=label)
    axes.legend(fontsize=7, ncols=2)
    axes.grid(alpha=0.3, which="both")
    drawn = io.BytesIO()
    figure.savefig(drawn, format="svg", metadata={"Date": None, "Creator": None})
    pyplot.close(figure)
    write_bytes(file, drawn.getvalue())


def write_report(report: Report) -> None:
    """Write the table, plots, pictures and the page into the report's folder."""
    import jinja2

    write_bytes(report.folder / "table.toml", tomli_w.dumps(report_table(report)).encode())
    environment = jinja2.Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    environment.filters["percent"] = lambda value: f"{100 * value:.3g} %"
    environment.filters["number"] = lambda value: "" if value is None else f"{value:.3g}"
    template = environment.from_string((files(__package__) / "page.html").read_text(encoding="utf-8"))
    text = template.render(
        report=report,
        version=__version__,
        plots=draw_plots(report),
        crops=draw_crops(report),
        maps=draw_maps(report),
        rows=[(one, times_faster(one, report.measured)) for one in report.measured],
        paths=PATHS,
    )
    write_bytes(report.folder / "index.html", text.encode())
