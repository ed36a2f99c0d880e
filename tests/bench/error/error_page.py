"""Results -> docs/quality/error.csv: the error of every variant, and of ways to store an image."""

from collections.abc import Mapping

from support.tables import publish

from bench.core.cases import JOBS
from bench.core.markdown import grid, number, percent
from bench.core.results import Table, folder, load, site_for

HEAD = """
# Error

The error of images, by variants of one setting each; the first row has the settings of the jobs but for weights
`average`. [Speed](speed.md) has the time that they take. `make bench-error` measures and writes this page.
"""


def write(quick: bool) -> None:
    """Write the page from all results there are; quick results go beside themselves."""
    found = {name: table for name in JOBS if (table := load(folder(quick), f"error-{name}"))}
    page = site_for(quick).pages / "error.md"
    parts = [HEAD, *errors(found), *containers(found)]
    page = publish(page, "\n\n".join(part.strip("\n") for part in parts) + "\n")
    print(page)


def errors(error: Mapping[str, Table]) -> list[str]:
    """A table of variants per job."""
    first = next(iter(error.values()))
    about = f"""
Against references with reuse off, other seeds and {first["hits"]} native hits per pixel, made in two halves. Ambient
light is the same for all. Errors are relative to the mean of the reference, averaged over
{len(first["lights"])} light positions:

- *RMSE*; *relMSE*: mean of (I - R)^2 / (R^2 + {first["epsilon"]}); *mean error*: mean of I - R.
- *At shadow edges*: RMSE and largest error where irradiance jumps, but neither normal nor depth.
- *Bias*: root of the squared bias, from two runs and the two halves, whose noise is independent: it contains no
  noise. Where the squared bias is less than twice its standard error, "below" that.
- *Flicker*: RMSE of the change of the error from one frame of the camera path to the next, over sqrt 2: equal to
  *RMSE* where the errors of two frames are independent.
"""
    head = ["", "RMSE", "relMSE", "mean error", "edges, RMSE", "edges, most", "bias", "flicker"]
    parts = [about]
    for name, table in error.items():
        rows = []
        for variant, t in table["variants"].items():
            rows.append(
                [
                    variant,
                    percent(t["rmse"]),
                    number(t["relmse"]),
                    percent(t["bias"], 2),
                    percent(t["edge_rmse"]),
                    percent(t["edge_max"]),
                    _bias(t),
                    percent(t["flicker"]),
                ]
            )
        known = f"The reference's own RMSE is {percent(table['noise'], 2)}."
        parts += [f"## {name}", f"Camera {', '.join(map(str, table['cameras']))}. {known}", grid(head, rows)]
    return parts


def _bias(t: Table) -> str:
    square, spread = t["squared_bias"], t["squared_bias_error"]
    if square < 2 * spread:
        return f"below {percent((max(square, 0) + 2 * spread) ** 0.5, 2)}"
    return percent(square**0.5, 2)


def containers(error: Mapping[str, Table]) -> list[str]:
    """Ways to store an image."""
    name, table = next(iter(error.items()))
    rows = [
        [
            stored,
            number(t["cpu_ms"]),
            number(t["wall_ms"]),
            number(t["bytes"] / 1024),
            percent(t["rmse"], 2) if "rmse" in t else "",
        ]
        for stored, t in table["formats"].items()
    ]
    head = ["", "one thread, processor ms", "all threads, ms per image", "KiB", "RMSE added"]
    return ["## Containers", f"An image of {name}, with no other work.", grid(head, rows)]
