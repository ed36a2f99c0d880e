"""Write docs/quality/light-from-cells.csv: rooms whose indirect light is hard to find by cells, against paths.

PYTHONPATH=tests python tests/hard/cells_report.py docs [PATHS]

The program's own walks trace the paths, PATHS per pixel of images of 64 x 48 pixels; cells have 2^20 samples, hits 8
rays, pixels 16 hits. *Mean*: of all light, minus the mean of paths. *All light*: root mean square error of means over
4 x 4 pixels, over their root mean square. *Indirect*: over the mean indirect light. The last case is one that cells get
wrong. Two rooms: a lamp in one room of 2 x 2.5 x 4 m, an eye in each.
"""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from support import tiny
from support.light_errors import light_error, paths_of, rendered
from support.lit_rooms import LIT_ROOMS, TOO_HARD
from support.pathtraced import path_traced
from support.tables import Section, write_csv
from support.two_rooms import rooms, wall

from framearray_cli.base.colour import srgb8_from_linear

METHODS: dict[str, dict[str, Any]] = {"obscurances": {}, "cells": {"indirect": {"method": "cells"}}}
PATHS = 512  # per pixel of a room
ROOM_PATHS = {0: 8192, 1: 256}  # per pixel of the dark and of the lit one of two rooms
HITS = 128  # per pixel of two rooms: few rays find the hole
ZOOM, GAP = 2, 4

HEAD = ("Case", "", "mean, cells", "all light, cells", "indirect, cells", "all light, obscurances", "noise of the mean")
WALLS_HEAD = ("Wall", "dark room, cells", "dark room, paths", "dark over lit, cells", "dark over lit, obscurances")
WALLS = {
    "closed, no thickness": (0.0, 0.0),
    "closed, 2 cm": (0.0, 0.02),
    "a hole of 15 cm, no thickness": (0.15, 0.0),
    "a hole of 15 cm, 2 cm": (0.15, 0.02),
}


def rows_of_rooms(n_paths: int, sheet: list[Any]) -> Iterator[list[str]]:
    """A row per room; its pictures join the sheet."""
    for name, room in (LIT_ROOMS | TOO_HARD).items():
        paths, direct = paths_of(room, n_paths), rendered(room, ambient=tiny.DARK)
        images = {method: rendered(room, **keys) for method, keys in METHODS.items()}
        found = {method: light_error(image, direct, paths) for method, image in images.items()}
        sheet.append([direct[0] + paths.mean(axis=0)[0], *(image[0] for image in images.values())])
        cells, other = found["cells"], found["obscurances"]
        shares = [
            f"{cells.mean:+.1%}",
            *(f"{x:.1%}" for x in (cells.whole, cells.indirect, other.whole, cells.mean_error)),
        ]
        yield [name, room.hard, *(share.replace("%", " %") for share in shares)]
        print(name, found, flush=True)


def rows_of_walls() -> Iterator[list[str]]:
    """A row per wall."""
    for name, (hole, thickness) in WALLS.items():
        walls = [*wall(0.0, hole), *(wall(thickness, hole) if thickness else [])]
        dark, lit = tiny.render_frames(rooms(walls, samples=2**20, hits=HITS), threads=2).images.mean(axis=(1, 2, 3, 4))
        by_obscurance = tiny.render_frames(rooms(walls, method="obscurance"), threads=2).images.mean(axis=(1, 2, 3, 4))
        truth = "0"
        if hole:
            paths = path_traced(rooms(walls), 0, ROOM_PATHS[0]).mean(axis=(1, 2, 3))
            truth = f"{paths.mean():.5f} +- {paths.std(ddof=1) / len(paths) ** 0.5:.5f}"
        yield [name, f"{dark:.5f}", truth, f"{dark / lit:.6f}", f"{by_obscurance[0] / by_obscurance[1]:.2f}"]


def save_sheet(rows: list[Any], file: Path) -> None:
    """Pictures side by side: by paths, by each method, and the difference of the last from paths about grey."""
    lines = []
    for row in rows:
        level = row[0].mean()
        shown = [srgb8_from_linear(0.4 * image / level) for image in row]
        shown.append(srgb8_from_linear(np.clip(0.2 + 0.4 * (row[-1] - row[0]) / level, 0, 1)))
        shown = [np.repeat(np.repeat(image, ZOOM, 0), ZOOM, 1) for image in shown]
        lines.append(np.concatenate([np.pad(image, ((0, GAP), (0, GAP), (0, 0))) for image in shown], axis=1))
    Image.fromarray(np.concatenate(lines)).save(file, quality=60)


def main(docs: Path, n_paths: int) -> None:
    """Measure all, and write the tables and their picture."""
    sheet: list[Any] = []
    sections = [
        Section("Light from cells, hard cases", HEAD, [*rows_of_rooms(n_paths, sheet)]),
        Section("Two rooms", WALLS_HEAD, [*rows_of_walls()]),
    ]
    save_sheet(sheet, docs / "pictures" / "light-from-cells.jpg")
    write_csv(docs / "quality" / "light-from-cells.csv", sections)


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else PATHS)
