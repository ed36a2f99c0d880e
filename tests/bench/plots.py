"""Results of the sweeps -> small SVG pictures."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from .results import Table

# What each plot shows: sweep, file, label of the axis, and how to find its value.
PLOTS: tuple[tuple[str, str, str, Callable[[Table], float]], ...] = (
    ("lights", "lights.svg", "light positions N_l", lambda r: r["lights"]),
    ("n_r", "reuse.svg", "frames before and after that share hits N_r", lambda r: r["n_r"]),
    ("threads", "threads.svg", "threads", lambda r: r["threads"]),
    ("triangles", "triangles.svg", "triangles", lambda r: r["triangles"]),
    ("resolution_sweep", "resolution.svg", "megapixels", lambda r: r["width"] * r["height"] / 1e6),
)
# Sweeps that need no logarithmic axis.
LINEAR = ("n_r",)


def draw(scaling: Table, folder: Path) -> dict[str, str]:
    """Draw every sweep; returns sweep -> the picture's place beside the page. Without matplotlib there are none."""
    try:
        import matplotlib
    except ImportError:
        return {}
    matplotlib.use("svg")
    matplotlib.rcParams.update({"svg.hashsalt": "framearray", "svg.fonttype": "none", "font.size": 9})
    folder.mkdir(parents=True, exist_ok=True)
    found = {}
    for sweep, name, label, size in PLOTS:
        rows = scaling.get(sweep, [])
        if len(rows) > 1:
            _plot(folder / name, label, [size(r) for r in rows], [r["ms"] for r in rows], sweep not in LINEAR)
            found[sweep] = f"{folder.name}/{name}"
    return found


def _plot(file: Path, label: str, sizes: list[float], ms: list[float], logarithmic: bool) -> None:
    from matplotlib import pyplot, ticker

    figure, axes = pyplot.subplots(figsize=(4.6, 2.7), layout="constrained")
    try:
        axes.plot(sizes, ms, "o-", color="#2b6cb0", markersize=4)
        axes.set_xlabel(label)
        axes.set_ylabel("ms an image")
        if logarithmic:
            axes.set_xscale("log")
        if logarithmic and max(ms) > 10 * min(ms):
            axes.set_yscale("log")
        else:
            axes.set_ylim(bottom=0)
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter(ticker.FuncFormatter(_tick))
        axes.grid(alpha=0.3)
        figure.savefig(file, metadata={"Date": None, "Creator": None})
    finally:
        pyplot.close(figure)


def _tick(value: float, _position: Any) -> str:
    """1,000 and more in words, less as it is."""
    for size, word in ((1e6, "M"), (1e3, "k")):
        if value >= size:
            return f"{value / size:g}{word}"
    return f"{value:g}"
