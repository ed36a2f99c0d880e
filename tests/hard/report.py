"""Write docs/quality/hard-cases.csv: rays with a known answer in rooms that are hard to trace, and the wrong ones.

PYTHONPATH=tests python tests/hard/report.py docs/quality/hard-cases.csv

Every room is closed and convex: a point inside sees all of the room and nothing outside. A cell contains leaks / rays
blocked where nothing is; for obscurances, rays that end at a wrong place. On walls: wrong / all rays.
"""

import inspect
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import test_random_streams as bad
from support.counting import (
    Count,
    eyes_on_walls,
    eyes_on_walls_lose,
    hemisphere_rays,
    lamps_on_walls,
    light_from_within,
    shadow_rays,
    visibility_rays,
)
from support.rooms import ON_WALLS, ROOMS
from support.staging import Stage, staged
from support.streams import all_chances, dependent, pairs, program
from support.tables import Section, write_csv
from test_reprojection import RIGHT, mean_of_many, million_hits

HITS = 50_000
FEWER = {"ball": 2_000}  # the right answers of the ball take its twenty thousand planes
# Name of the column, unit of length, and how far away the room is.
PLACES = (("as it is", 1.0, 0.0), ("times 1e-6", 1e-6, 0.0), ("times 1e6", 1e6, 0.0), ("moved by 1e7", 1.0, 1e7))


def about(name: str) -> str:
    """The first cell of a room's row."""
    text = (inspect.getdoc(ROOMS[name]) or "").split(":")[0].rstrip(".")
    return f"{name.replace('_', ' ')}: {text[0].lower()}{text[1:]}"


def rooms_sections() -> Iterator[Section]:
    """Three tables, one per kind of ray."""
    kinds: dict[str, Callable[[Stage], tuple[Count, ...]]] = {
        "Shadow rays": shadow_rays,
        "Visibility rays": visibility_rays,
        "Rays of obscurances": lambda stage: (hemisphere_rays(stage),),
    }
    cells: dict[str, dict[str, list[str]]] = {kind: {name: [] for name in ROOMS} for kind in kinds}
    for name in ROOMS:
        for _, size, at in PLACES:
            with staged(name, size=size, at=(at, -at, at), n=FEWER.get(name, HITS)) as stage:
                for kind, count in kinds.items():
                    cells[kind][name].append(" / ".join(str(found.wrong) for found in count(stage)))
    for kind in kinds:
        rows = [[about(name), *cells[kind][name]] for name in ROOMS]
        yield Section("Rays in closed rooms", (kind, *(name for name, _, _ in PLACES)), rows)


def walls_sections() -> Iterator[Section]:
    """Lamps and eyes exactly on a wall, an edge, a corner."""
    rows = []
    for name in ON_WALLS:
        with staged(name) as stage:
            looks = [eyes_on_walls(stage, inwards, 2 if name == "ball" else 64).wrong for inwards in (True, False)]
            counts = [lamps_on_walls(stage), light_from_within(name)]
            counts += [*(Count(len(wrong), int(wrong.sum())) for wrong in looks), eyes_on_walls_lose(stage)]
        cells = [f"{count.wrong} / {count.rays}" for count in counts]
        if name == "thin":
            cells[3] = "the outer face"
        rows.append([name.replace("_", " "), *cells])
    head = ("Room", "lamps on walls", "lamps within", "eyes, inwards", "eyes, outwards", "hits lost")
    yield Section("Lamps and eyes on walls", head, rows)


def sums_sections() -> Iterator[Section]:
    """Very many hits in one pixel, unevenly bright; and of one eye in one pixel of another, by the whole program."""
    rows = []
    for n in (10_000, 1_000_000):
        found, exact = mean_of_many(n)
        rows.append([str(n), f"{np.abs(found / exact - 1).max():.1e}"])
    hits, value = million_hits()
    rows.append([f"{hits:.0f}, by the whole program", f"{np.abs(value / RIGHT - 1).max():.1e}"])
    yield Section("A million hits in one pixel", ("Hits", "largest relative error"), rows)


def streams_sections() -> Iterator[Section]:
    """Independence of scrambles, by Holm's rule over all tests; bad scrambles fail."""
    found, rows = all_chances(program), []
    title = f"Random streams: {len(pairs())} pairs of places, {len(found)} tests, {len(dependent(found))} fail"
    with np.errstate(over="ignore"):
        for words in bad.BAD:
            text = (inspect.getdoc(words) or "").rstrip(".")
            rows.append([f"{text[0].lower()}{text[1:]}", str(len(dependent(all_chances(words))))])
    yield Section(title, ("Scramble", "tests that fail"), rows)


SECTIONS = (rooms_sections, walls_sections, sums_sections, streams_sections)

if __name__ == "__main__":
    write_csv(Path(sys.argv[1]), [section for sections in SECTIONS for section in sections()])
