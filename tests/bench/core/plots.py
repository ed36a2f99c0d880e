"""Small SVG plots of results."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any


@contextmanager
def plotted(
    file: Path, panels: int = 1, size: tuple[float, float] = (4.6, 2.7), **settings: Any
) -> Iterator[list[Any]]:
    """Yield the axes of a figure, then save it; equal results give equal files.

    Args:
        settings: of all axes, as `Axes.set` has them.
    """
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams.update({"svg.hashsalt": "framearray", "svg.fonttype": "none", "font.size": 9})
    from matplotlib import pyplot, ticker

    figure, (axes,) = pyplot.subplots(1, panels, figsize=size, sharey=True, squeeze=False, layout="constrained")
    try:
        yield list(axes)
        for one in axes:
            one.set(**settings)
            one.grid(alpha=0.3)
            one.xaxis.set_major_formatter(ticker.FuncFormatter(tick))
            one.xaxis.set_minor_formatter("")
        if axes[0].get_legend_handles_labels()[0]:
            figure.legend(*axes[0].get_legend_handles_labels(), fontsize=7, ncols=3, loc="outside lower center")
        file.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(file, metadata={"Date": None, "Creator": None})
    finally:
        pyplot.close(figure)


def tick(value: float, _position: Any) -> str:
    """Label of an axis: 1,000 and more in words, less as it is."""
    for size, word in ((1e6, "M"), (1e3, "k")):
        if value >= size:
            return f"{value / size:g}{word}"
    return f"{value:g}"
