"""Speed against error of the three jobs: `framearray report`, and from its tables docs/quality/report-*.csv."""

import shutil
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from support.tables import Section, number, percent, times, write_csv

from bench.core.cases import job_named
from bench.core.results import DOCS, RESULTS
from framearray_cli.report import make_report, write_report
from framearray_cli.report.page import draw_crops

PLOTS = ("true-light-and-time", "error-and-time")
QUALITY = 88  # of the crops' JPG


def measure(name: str) -> None:
    """Make the report of a job in out/bench, or only its missing references, and copy its tables, plots and crops."""
    folder = RESULTS / f"report-{name}"
    report = make_report(job_named(name, False), folder)
    write_report(report)
    crops = [folder / f"crop-{i}.png" for i, _ in enumerate(draw_crops(report))]
    _save_strip(crops, DOCS.pictures / f"report-{name}.jpg")
    for plot in PLOTS:
        if (file := folder / f"{plot}.svg").is_file():
            shutil.copyfile(file, DOCS.plots / f"report-{name}-{plot}.svg")
    table = tomllib.loads((folder / "table.toml").read_text(encoding="utf-8"))
    own, truth = table["settings"][0], table.get("truth", {"settings": ()})
    shown = [row for row in truth["settings"] if row["name"] == own["name"] or row["indirect"] != own["indirect"]]
    true_rows = [
        (r["name"], number(r["ms"]), percent(r["rmse"]), percent(r["rmse_of_squares"]), percent(r["mean_off"]))
        for r in shown
    ]
    title = f"Speed against error: {name}"
    head = ("", "ms", "RMSE", "bias", "noise", "hits per pixel", "times faster")
    sections = [
        Section(title, ("", "ms", "RMSE", "of 4 x 4 means", "mean off"), true_rows),
        Section(title, head, [_row(row) for row in table["settings"]]),
    ]
    write_csv(DOCS.tables / f"report-{name}.csv", sections)


def _row(row: dict[str, Any]) -> list[str]:
    faster = row.get("times_faster_than_scratch")
    return [
        row["name"], number(row["ms"]), percent(row["rmse"]), percent(row["bias"], 2), percent(row["noise"], 2),
        number(row["accepted_hits"]), times(faster) if faster else "",
    ]  # fmt: skip


def _save_strip(files: list[Path], strip: Path) -> None:
    """Put the crops of a report next to each other."""
    crops = [np.asarray(Image.open(file).convert("RGB")) for file in files]
    gap = np.full((crops[0].shape[0], 6, 3), 255, np.uint8)
    joined = np.concatenate([part for crop in crops for part in (crop, gap)][:-1], axis=1)
    Image.fromarray(joined).save(strip, quality=QUALITY)
