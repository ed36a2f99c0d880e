"""Plots and pictures of docs/quality/ambient.md."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from PIL import Image as Pillow

from bench.core.plots import ready, tick
from bench.core.results import Table
from framearray_cli.base.arrays import Float32, Image
from framearray_cli.base.colour import srgb8_from_linear

from .levels import METHODS

COLOURS = {"eye": "#2b6cb0", "fit": "#2f855a"}
STRIPS = ("kitchen", "stairs", "cabin")  # jobs whose pictures are shown
WIDTH, GAP, QUALITY = 240, 4, 80  # of one picture and between two, pixels; of JPEG


def draw(levels: Mapping[str, Table], pictures: Mapping[str, Table], folder: Path) -> dict[str, Path]:
    """Draw the results; returns plot -> its file. Without matplotlib there are none."""
    if not ready(folder):
        return {}
    found = {}
    if levels:
        found["walks"] = folder / "ambient-walks.svg"
        _walks(levels, found["walks"])
    if pictures:
        found["levels"] = folder / "ambient-levels.svg"
        _levels(pictures, found["levels"])
    return found


def _walks(levels: Mapping[str, Table], file: Path) -> None:
    """Spread and reported error against the number of walks, a scene a panel."""
    from matplotlib import pyplot, ticker

    columns = min(len(levels), 4)
    rows = -(-len(levels) // columns)
    figure, grid = pyplot.subplots(
        rows,
        columns,
        figsize=(2.4 * columns, 2.2 * rows),
        layout="constrained",
        sharex=True,
        sharey=True,
        squeeze=False,
    )
    try:
        for axes in grid.ravel()[len(levels) :]:
            axes.set_visible(False)
        for axes, (name, table) in zip(grid.ravel(), levels.items(), strict=False):
            for method in METHODS:
                found = table["methods"][method]["rows"]
                paths, mean = [row["paths"] for row in found], np.array([row["mean"] for row in found])
                spread, reported = (np.array([row[key] for row in found]) for key in ("spread", "reported"))
                axes.plot(paths, 100 * spread / mean, color=COLOURS[method], label=method)
                axes.plot(paths, 100 * reported / mean, "o", color=COLOURS[method], markersize=3)
            axes.set_title(name, fontsize=9)
            axes.set_xscale("log", base=4)
            axes.set_yscale("log")
            axes.grid(alpha=0.3)
            axes.xaxis.set_major_formatter(ticker.FuncFormatter(tick))
            axes.yaxis.set_major_formatter(ticker.FuncFormatter(tick))
        grid[0, 0].legend(fontsize=8)
        figure.supxlabel("walks", fontsize=9)
        figure.supylabel("error of I_A, %", fontsize=9)
        figure.savefig(file, metadata={"Date": None, "Creator": None})
    finally:
        pyplot.close(figure)


def _levels(pictures: Mapping[str, Table], file: Path) -> None:
    """Mean indirect light over the path-traced one, by scene and method."""
    from matplotlib import pyplot, ticker

    figure, axes = pyplot.subplots(figsize=(6.4, 3.0), layout="constrained")
    try:
        places = np.arange(len(pictures))
        for k, method in enumerate(METHODS):
            ratios = [table["model"][method]["indirect"]["ratio"] for table in pictures.values()]
            axes.plot(places + 0.12 * (k - 1), ratios, "o", color=COLOURS[method], label=method)
        axes.axhline(1.0, color="#333333", linewidth=1)
        axes.set_yscale("log", base=2)
        axes.yaxis.set_major_formatter(ticker.FuncFormatter(tick))
        axes.set_xticks(places, list(pictures), rotation=30, ha="right")
        axes.set_ylabel("indirect light over\nthe path-traced one")
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8)
        figure.savefig(file, metadata={"Date": None, "Creator": None})
    finally:
        pyplot.close(figure)


def strips(pictures: Mapping[str, Table], results: Path, folder: Path) -> dict[str, Path]:
    """Pictures side by side, one file per job; returns name -> file."""
    found = {}
    for name in STRIPS:
        if name in pictures:
            with np.load(results / f"ambient-shown-{name}.npz") as kept:
                made = strip(kept["eye"], kept["fit"], kept["traced"])
            folder.mkdir(parents=True, exist_ok=True)
            found[name] = folder / f"ambient-{name}.jpg"
            made.save(found[name], "JPEG", quality=QUALITY, optimize=True)
    return found


def strip(eye: Image, fit: Image, traced: Image) -> Pillow.Image:
    """`eye`, `fit` and path traced, and the first two minus the third, side by side."""
    parts = [srgb8_from_linear(image) for image in (eye, fit, traced)]
    parts += [signed(image - traced, float(traced.mean())) for image in (eye, fit)]
    height = round(WIDTH * eye.shape[0] / eye.shape[1])
    pasted = Pillow.new("RGB", (len(parts) * (WIDTH + GAP) - GAP, height), "white")
    for i, part in enumerate(parts):
        pasted.paste(Pillow.fromarray(part).resize((WIDTH, height), Pillow.Resampling.LANCZOS), (i * (WIDTH + GAP), 0))
    return pasted


def signed(difference: Float32, scale: float) -> np.ndarray:
    """A difference (h, w, 3) as 8 bit colours: white is none, red too bright, blue too dark, full at +- scale."""
    share = np.clip(difference.mean(axis=-1) / scale, -1, 1)
    colours = np.ones((*share.shape, 3))
    colours[..., 0] -= np.maximum(-share, 0)
    colours[..., 1] -= np.abs(share)
    colours[..., 2] -= np.maximum(share, 0)
    return np.asarray(np.round(255 * colours), np.uint8)
