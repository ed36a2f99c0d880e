"""A report's numbers as tables: TOML for programs, CSV for spreadsheets."""

import csv
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import tomli_w

from framearray_cli.base.files import whole_file

from .front import Advice, times_faster
from .measure import Measured
from .run import Report
from .settings import Settings
from .true_light import TrueLight, TrueMeasured, truth_of

COLUMNS = (
    "name", "n_r", "weights", "hits", "obscurance", "indirect",
    "one_light", "ms", "rmse", "relmse", "flip", "mean_off", "edge_rmse", "edge_max", "bias", "noise", "squared_bias",
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


def write_tables(report: Report) -> None:
    """Write table.csv, truth.csv and table.toml into the report's folder.

    Raises:
        OutputError: they cannot be written.
    """
    rows = [table_row(one, report) for one in report.measured]
    columns = [name for name in COLUMNS if name != "flip" or report.flip is not None]
    _write_csv(report.folder / "table.csv", rows, columns)
    table: dict[str, Any] = {
        "job": report.job.name,
        "cameras": [c for frames in report.probes.cameras for c in frames],
        "lights": list(report.probes.lights),
        "reference": {"hits": report.reference_hits, "rmse": report.reference_noise},
        "settings": rows,
        "offsets": [asdict(offset) for offset in report.offsets],
        "advice": [_advice_table(one, one.best.quality.rmse if one.best else None, report) for one in report.advice],
    }
    if report.true_light is not None:
        table["truth"] = _truth_table(report.true_light, report)
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
