"""The part of docs/quality/speed.csv on the size of a job: a plot and a table per sweep."""

import statistics
from collections.abc import Callable, Mapping

from bench.core.markdown import grid, number, percent, total
from bench.core.results import Table


def scaling(found: Table, drawn: Mapping[str, str]) -> list[str]:
    """Sweeps: a plot and a table each."""
    width, height = found["resolution"]
    about = f"""
`jobs/{found["job"]}.toml` at {width} x {height}, weights `average`, all shadows tested, nothing written; one number
changes at a time. The cameras are those of the middle of the path, where mirrors make images more expensive than
the medians above. Other programs took {percent(statistics.median(found["busy"]), 2)} of the cores (median).
"""
    parts = ["## Scaling", about]
    for name, title, text, head, cells in SWEEPS:
        rows = [[*cells(row), number(row["ms"]), number(total(row["rays"]))] for row in found[name]]
        parts.append(f"### {title}")
        if name in drawn:
            parts.append(f"![{title}]({drawn[name]})")
        parts += [text, grid([*head, "ms per image", "rays per pixel and image"], rows)]
    return parts


# A sweep: its name, title, explanation, columns that say how large the job was, and their cells.
SWEEPS: tuple[tuple[str, str, str, list[str], Callable[[Table], list[str]]], ...] = (
    ("lights", "Light positions", "The path of the light stays; its steps get shorter.", ["N_l"],
     lambda r: [str(r["lights"])]),
    ("n_r", "Frames that share hits", "With 2 native hits per pixel and frame; more frames, more hits per pixel.",
     ["N_r", "hits per pixel"], lambda r: [str(r["n_r"]), f"{r['hits'][0]:.1f}"]),
    ("threads", "Threads", "One per core, and fewer. *Serial*: share of the time in which no thread traces or "
     "composes. With one thread it is\nAmdahl's figure s: n threads are at most 1 / (s + (1 - s) / n) times as fast.",
     ["threads", "serial"], lambda r: [str(r["threads"]), f"{r['serial']:.1%}"]),
    ("cameras", "Cameras", "The camera path there and back, several times over.", ["N_c"],
     lambda r: [str(r["cameras"])]),
    ("triangles", "Triangles", "A generated room with 50 spheres of more and more triangles. *Scene*: cleaning and "
     "merging, *Embree*: its\nacceleration structure, seconds.", ["triangles", "scene, s", "Embree, s"],
     lambda r: [f"{r['triangles']:,}", f"{r['scene_s']:.2f}", f"{r['embree_s']:.2f}"]),
    ("resolution_sweep", "Resolution", "Each in a process of its own.", ["pixels", "GiB at most"],
     lambda r: [f"{r['width']} x {r['height']}", f"{r['peak'] / 2**30:.2f}"]),
)  # fmt: skip
