"""Results -> small SVG pictures."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

from .results import Table

# The plots: sweep, file, label of the axis, and how to find its value.
PLOTS: tuple[tuple[str, str, str, Callable[[Table], float]], ...] = (
    ("lights", "lights.svg", "light positions N_l", lambda r: r["lights"]),
    ("n_r", "reuse.svg", "frames before and after that share hits N_r", lambda r: r["n_r"]),
    ("threads", "threads.svg", "threads", lambda r: r["threads"]),
    ("triangles", "triangles.svg", "triangles", lambda r: r["triangles"]),
    ("resolution_sweep", "resolution.svg", "megapixels", lambda r: r["width"] * r["height"] / 1e6),
)
# Sweeps that need no logarithmic axis.
LINEAR = ("n_r",)
COLOURS = ("#2b6cb0", "#c53030", "#2f855a")
LINES = {"average": "--", "balance": "-"}

Point: TypeAlias = tuple[int, float, float]


def draw(scaling: Table, folder: Path) -> dict[str, Path]:
    """Draw every sweep; returns sweep -> its plot. Without matplotlib there are none."""
    if not ready(folder):
        return {}
    found = {}
    for sweep, name, label, size in PLOTS:
        rows = scaling.get(sweep, [])
        if len(rows) > 1:
            _plot(folder / name, label, [size(r) for r in rows], [r["ms"] for r in rows], sweep not in LINEAR)
            found[sweep] = folder / name
    return found


def ready(folder: Path) -> bool:
    """Whether there is matplotlib; it is set up so that the same results give the same files in `folder`."""
    try:
        import matplotlib
    except ImportError:
        return False
    matplotlib.use("svg")
    matplotlib.rcParams.update({"svg.hashsalt": "framearray", "svg.fonttype": "none", "font.size": 9})
    folder.mkdir(parents=True, exist_ok=True)
    return True


def _plot(file: Path, label: str, sizes: list[float], ms: list[float], logarithmic: bool) -> None:
    from matplotlib import pyplot, ticker

    figure, axes = pyplot.subplots(figsize=(4.6, 2.7), layout="constrained")
    try:
        axes.plot(sizes, ms, "o-", color="#2b6cb0", markersize=4)
        axes.set_xlabel(label)
        axes.set_ylabel("ms per image")
        if logarithmic:
            axes.set_xscale("log")
        if logarithmic and max(ms) > 10 * min(ms):
            axes.set_yscale("log")
        else:
            axes.set_ylim(bottom=0)
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter(ticker.FuncFormatter(tick))
        axes.grid(alpha=0.3)
        figure.savefig(file, metadata={"Date": None, "Creator": None})
    finally:
        pyplot.close(figure)


def draw_bias(found: Mapping[tuple[str, str], Mapping[str, Sequence[Point]]], folder: Path) -> Path | None:
    """Draw squared bias against hits, a panel per camera; returns the plot, or None without matplotlib.

    Args:
        found: (job, camera) -> weights -> (hits, squared bias, standard error).
    """
    if not ready(folder):
        return None
    from matplotlib import pyplot

    file = folder / "bias.svg"
    cameras = list(dict.fromkeys(camera for _, camera in found))
    colours = dict(zip(dict.fromkeys(job for job, _ in found), COLOURS, strict=False))
    figure, panels = pyplot.subplots(
        1, len(cameras), figsize=(2.9 * len(cameras), 3.1), sharey=True, squeeze=False, layout="constrained"
    )
    try:
        for axes, camera in zip(panels[0], cameras, strict=True):
            for (job, of), curves in found.items():
                for weights, curve in curves.items() if of == camera else ():
                    _curve(axes, curve, colours[job], LINES[weights], f"{job}, {weights}")
            axes.set(xscale="log", yscale="log", title=camera, xlabel="hits per pixel and frame")
            axes.xaxis.set_major_formatter(tick)
            axes.xaxis.set_minor_formatter("")
            axes.grid(alpha=0.3)
        panels[0][0].set_ylabel("squared bias over the squared mean")
        figure.legend(*panels[0][0].get_legend_handles_labels(), fontsize=7, ncols=3, loc="outside lower center")
        figure.savefig(file, metadata={"Date": None, "Creator": None})
    finally:
        pyplot.close(figure)
    return file


def _curve(axes: Any, curve: Sequence[Point], colour: str, line: str, label: str) -> None:
    """Points that stand out of the noise with their standard errors, and bounds of the others."""
    seen = [point for point in curve if point[1] > 2 * point[2]]
    if seen:
        hits, bias, error = zip(*seen, strict=True)
        axes.errorbar(hits, bias, error, color=colour, linestyle=line, marker="o", markersize=3, label=label)
    below = [(hits, max(bias, 0.0) + 2 * error) for hits, bias, error in curve if bias <= 2 * error]
    if below:
        axes.plot(*zip(*below, strict=True), "v", color=colour, fillstyle="none", markersize=5)


def tick(value: float, _position: Any) -> str:
    """Label of an axis: 1,000 and more in words, less as it is."""
    for size, word in ((1e6, "M"), (1e3, "k")):
        if value >= size:
            return f"{value / size:g}{word}"
    return f"{value:g}"
