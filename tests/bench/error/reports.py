"""Speed against error of the three jobs: `framearray report`, and from its tables docs/quality/report-*.csv."""

import shutil
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from support.tables import publish

from bench.core.cases import job_named
from bench.core.machine import describe
from bench.core.markdown import grid, number, percent, times
from bench.core.results import DOCS, RESULTS, Table, load, save
from bench.speed.speed import log
from framearray_cli.report import ReportOptions, make_report, write_report
from framearray_cli.report.page import draw_crops

PLOTS = ("true-light-and-time", "error-and-time", "bias-and-noise", "by-offset", "flicker")
QUALITY = 88  # of the crops' JPG

PAGE = """
# Speed against error: {name}

The cost and the error of each setting of a job: the report of `framearray report jobs/{name}.toml`, as
`python -m bench report {name}` wrote it, from the folder `tests`. {cameras} cameras under {lights} light positions, at
{width} x {height} pixels, against references of {reference_hits:,} hits per pixel, whose own error is
{reference_noise}. RMSE relative to the mean of the reference; ms per image before writing, of all
{n_lights} light positions. Machine: {machine}.

{truth}{summary}

![Error against time](../plots/report-{name}-error-and-time.svg)

*Every setting that was tried; both axes logarithmic.*

![Crops](../pictures/report-{name}.jpg)

*{captions}.*

{table}

*Times faster*: than images from scratch with the same RMSE, on the line through the measured ones, both axes
logarithmic. *Flicker*: RMSE of the difference of neighbours along the camera and along the light path.
In bold: the front, where no tried setting is both faster and more exact.

{advice}

![Bias and noise](../plots/report-{name}-bias-and-noise.svg)
{more}
"""


def measure(name: str) -> None:
    """Make the report of a job in out/bench, or only its missing references, and write its page."""
    folder = RESULTS / f"report-{name}"
    job = job_named(name, False)
    report = make_report(job, folder, ReportOptions())
    write_report(report)
    save(
        folder,
        "about",
        {"machine": describe(), "resolution": list(job.camera.resolution), "n_lights": job.light.frames},
    )
    save(folder, "captions", {"captions": [crop.caption for crop in draw_crops(report)]})
    log(f"{folder / 'index.html'}")


def write(name: str) -> None:
    """Write the page of a report that was made."""
    folder = RESULTS / f"report-{name}"
    about, kept = load(folder, "about"), load(folder, "captions")
    if about is None or kept is None:
        return
    table = tomllib.loads((folder / "table.toml").read_text(encoding="utf-8"))
    pictures([folder / f"crop-{i}.png" for i in range(len(kept["captions"]))], name)
    plots = [plot for plot in PLOTS if (folder / f"{plot}.svg").is_file()]
    for plot in plots:
        shutil.copyfile(folder / f"{plot}.svg", DOCS.plots / f"report-{name}-{plot}.svg")
    width, height = about["resolution"]
    words = PAGE.strip().format(
        name=name,
        cameras=len(table["cameras"]),
        lights=len(table["lights"]),
        width=width,
        height=height,
        n_lights=about["n_lights"],
        machine="{processor}, {cores} cores".format(**about["machine"]),
        reference_hits=table["reference"]["hits"],
        reference_noise=percent(table["reference"]["rmse"], 2),
        truth=true_light(table, name),
        summary=summary(table),
        captions="; ".join(kept["captions"]),
        table=rows(table),
        advice=advice(table),
        more="".join(f"\n![{plot}](../plots/report-{name}-{plot}.svg)\n" for plot in plots if plot in PLOTS[3:]),
    )
    page = DOCS.pages / f"report-{name}.md"
    page = publish(page, words.rstrip() + "\n")
    log(str(page))


def true_light(table: Table, name: str) -> str:
    """The plot of errors with respect to true light, and how near each method comes; empty without."""
    truth = table.get("truth")
    if truth is None:
        return ""
    own = table["settings"][0]["indirect"]
    shown = [row for row in truth["settings"] if row["name"] == table["settings"][0]["name"] or row["indirect"] != own]
    head = ("", "ms", "RMSE", "of 4 x 4 means", "mean off")
    found = grid(
        head,
        [
            [
                row["name"],
                number(row["ms"]),
                percent(row["rmse"]),
                percent(row["rmse_of_squares"]),
                percent(row["mean_off"]),
            ]
            for row in shown
        ],
    )
    return (
        f"![Error with respect to true light against time](../plots/report-{name}-true-light-and-time.svg)\n\n"
        f"*With respect to true light, by paths of the program's own: {len(truth['cameras'])} cameras under "
        f"{len(truth['lights'])} light positions, {truth['reference']['hits']} hits per pixel.*\n\n{found}\n\n"
    )


def summary(table: Table) -> str:
    """The job's own settings in a sentence, and the best factor against images from scratch."""
    own = table["settings"][0]
    reused = [row for row in table["settings"] if not row["one_light"]]
    best = max(reused, key=lambda row: row.get("times_faster_than_scratch", 0.0))
    gain, most = (times(one["times_faster_than_scratch"]) for one in (own, best))
    return (
        f"As the job says: {number(own['ms'])} ms per image with an error of {percent(own['rmse'])}. Images from "
        f"scratch with that error take **{gain}** as long. The largest factor is {most}, `{best['name']}`: "
        f"{number(best['ms'])} ms, {percent(best['rmse'])}."
    )


def rows(table: Table) -> str:
    """The time and the error of every setting."""
    head = ("", "ms", "RMSE", "bias", "noise", "FLIP", "flicker", "hits per pixel", "times faster")
    return grid(head, [_row(row) for row in table["settings"]])


def _row(row: dict[str, Any]) -> list[str]:
    flicker = [percent(row[f"flicker_{axis}"], 2) for axis in ("camera", "light") if f"flicker_{axis}" in row]
    name = f"**{row['name']}**" if row["on_the_front"] else row["name"]
    faster = row.get("times_faster_than_scratch")
    return [
        name, number(row["ms"]), percent(row["rmse"]), percent(row["bias"], 2), percent(row["noise"], 2),
        number(row["flip"]), ", ".join(flicker), number(row["accepted_hits"]), times(faster) if faster else "",
    ]  # fmt: skip


def advice(table: Table) -> str:
    """The cheapest settings for an error, as lines of a job."""
    found = []
    for one in table["advice"]:
        if "settings" not in one:
            found.append(f"For an error of {percent(one['error'])}: no tried setting reaches it.")
            continue
        lines = "\n".join(one["lines"]) or "# as the job is"
        found.append(
            f"For an error of {percent(one['error'])} ({number(one['ms'])} ms, {percent(one['rmse'])}):\n\n"
            f"```toml\n{lines}\n```"
        )
    return "\n\n".join(found)


def pictures(files: list[Path], name: str) -> None:
    """Put the crops of a report beside each other into docs/pictures."""
    crops = []
    for file in files:
        with Image.open(file) as image:
            crops.append(np.asarray(image.convert("RGB")))
    gap = np.full((crops[0].shape[0], 6, 3), 255, np.uint8)
    strip = np.concatenate([part for crop in crops for part in (crop, gap)][:-1], axis=1)
    Image.fromarray(strip).save(DOCS.pictures / f"report-{name}.jpg", quality=QUALITY)
