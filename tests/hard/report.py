# ruff: noqa: E501 - rows of tables
"""Write docs/quality/hard-cases.csv: rays with a known answer in rooms that are hard to trace, and the wrong ones.

PYTHONPATH=tests python tests/hard/report.py docs/quality/hard-cases.csv
"""

import inspect
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import test_random_streams as bad
from support.counting import (
    GRAZING,
    LOWEST,
    Count,
    eyes_on_walls,
    eyes_on_walls_lose,
    hemisphere_rays,
    lamps_on_walls,
    light_from_within,
    shadow_rays,
    visibility_rays,
)
from support.pictures import FLIPPED, ROUNDING
from support.rooms import ON_WALLS, ROOMS
from support.staging import Stage, staged
from support.streams import all_chances, dependent, pairs, program
from support.tables import publish
from test_light_in_closed_rooms import allowed
from test_reprojection import RIGHT, million_hits
from test_sums import mean_of_many

HITS = 50_000
FEWER = {"ball": 2_000}  # the right answers of the ball take its twenty thousand planes
# Name of the column, unit of length, and how far away the room is.
PLACES = (
    ("as it is", 1.0, 0.0),
    ("times 1e-6", 1e-6, 0.0),
    ("times 1e6", 1e6, 0.0),
    ("moved by 1e7", 1.0, 1e7),
)

HEAD = """# Hard cases

Written by `PYTHONPATH=tests python tests/hard/report.py docs/quality/hard-cases.csv`; `tests/hard/` tests
all of it.
"""

ROOMS_HEAD = f"""
## Rays in closed rooms

Every room is closed and convex: an inside point sees all of the room and nothing outside. So the answer of each ray
is known. {HITS:,} points of each room ({FEWER["ball"]:,} of the ball), with

- shadow rays to five lamps inside and five outside;
- visibility rays of reused hits to five eyes inside and five outside, each of which looks all round;
- five obscurance rays per point: each must meet the wall that the formula of a plane gives, at the place it gives.

A cell gives leaks / rays blocked where nothing is; for obscurances, rays that end at a wrong place.
In the wedge, points nearer to its edge than rays start above a surface, divided by the tangent of a degree, lie behind
the other wall for such a ray: at most {allowed("wedge", 5 * HITS)} of {5 * HITS:,} blocked rays are allowed for that, and none elsewhere.
"""

WALLS_HEAD = f"""
## Lamps and eyes on walls

Lamps and eyes exactly on a wall, an edge, a corner. Wrong / all rays:

- *lamps on walls*: shadows of lamps on points that face them. Shadow rays end 1e-4 of their length before a lamp; so
  points lower above the lamp's wall than {LOWEST:g} of half the room do not count;
- *lamps within*: light of lamps inside the room on a box around it, and on the room's outside. A lamp nearer to a wall
  than 1e-4 of its distance from a point shines through that wall; none here is;
- *eyes on walls*: their rays into the room, and out of it, where nothing may be seen;
- *hits lost*: hits that such eyes face, more than {GRAZING:g} of the distance above their wall, and do not take over.
"""

CASES = f"""
## Pictures and messages

| Case | What must hold | Test |
|---|---|---|
| all lengths times 1e-6 to 1e6, or moved by 1e7 | fewer than {FLIPPED:.0%} of the pixels differ by more than {ROUNDING:g} of the mean: samples that pass an edge on its other side | `tests/hard/test_pictures_of_hard_cases.py` |
| moved by 1e7 by a node, by two nodes one of which has a matrix, in an OBJ, in an ASCII PLY | the same | `tests/hard/test_scenes_far_away.py` |
| intensities times 1e-12 to 1e12 | all values in proportion, to 1e-5 | `tests/hard/test_pictures_of_hard_cases.py` |
| fields of view of 1 and 170 degrees | every pixel that of the slow twin | `tests/engine/test_oracle.py` |
| ranges of obscurance of 0, infinity, or no number | a message, exit code 2, nothing written | `tests/cli/test_messages.py` |
| ranges from 1e-9 to 1e12 | W is the average reflectivity, or goes to 0 | `tests/hard/test_pictures_of_hard_cases.py` |
| reflectivity 0 and 1, in a closed room too | black, or finite | the same file |
| a lamp on a floor, a wall, a vertex, at an eye, inside a mesh | light of the first four arrives; that of the last stays inside | the same file |
| a sun parallel to walls | they get exactly nothing | the same file |
| an eye inside a wall, in a closed box, looking along up | what a point there sees | the same file |
| an eye on a surface | nothing of that surface: above the floor's horizon the picture of an eye just above the floor | the same file |
| equal eyes in a row, with both weights | equal means, which are those without reuse, by z-tests of all pixels | `tests/stat/test_pixels.py` |
| facing mirrors of reflectivity 1, 16 bounces | nothing brighter than the background | `tests/hard/test_pictures_of_hard_cases.py` |
| points exactly on borders of pixels and of the image, behind an eye, in its plane | each in one pixel, or none | `tests/hard/test_reprojection.py` |
| eyes that move by exactly one pixel or one image, turn round, pass a wall, pass things | evenly lit pictures stay even; every pixel that of the slow twin | `tests/hard/test_reprojection.py`, `tests/engine/test_oracle.py` |
| degenerate, doubled and non-finite triangles, mixed windings | rooms *broken* and *mixed* above; counted and reported | `tests/scene/test_scene.py` |
"""


def about(name: str) -> str:
    """The first cell of a room's row."""
    text = (inspect.getdoc(ROOMS[name]) or "").split(":")[0].rstrip(".")
    return f"| *{name.replace('_', ' ')}*: {text[0].lower()}{text[1:]} |"


def pair(counts: tuple[Count, ...]) -> str:
    return " / ".join(str(count.wrong) for count in counts)


def rooms_section() -> Iterator[str]:
    """Three tables, one per kind of ray, and all counts together."""
    kinds: dict[str, Callable[[Stage], tuple[Count, ...]]] = {
        "Shadow rays": shadow_rays,
        "Visibility rays": visibility_rays,
        "Rays of obscurances": lambda stage: (hemisphere_rays(stage),),
    }
    cells: dict[str, dict[str, list[str]]] = {kind: {name: [] for name in ROOMS} for kind in kinds}
    rays = leaks = held_up = 0
    for name in ROOMS:
        for _, size, at in PLACES:
            with staged(name, size=size, at=(at, -at, at), n=FEWER.get(name, HITS)) as stage:
                for kind, count in kinds.items():
                    found = count(stage)
                    cells[kind][name].append(pair(found))
                    rays += sum(c.rays for c in found)
                    leaks += found[0].wrong
                    held_up += sum(c.wrong for c in found[1:])
    yield ROOMS_HEAD
    yield f"In all {rays:,} rays: {leaks} leaks or wrong ends, {held_up} blocked."
    for kind in kinds:
        yield f"\n| {kind} | " + " | ".join(name for name, _, _ in PLACES) + " |"
        yield "|---|" + "---:|" * len(PLACES)
        for name in ROOMS:
            yield f"{about(name)} " + " | ".join(cells[kind][name]) + " |"


def walls_section() -> Iterator[str]:
    """Lamps and eyes on walls."""
    yield WALLS_HEAD
    yield "| Room | lamps on walls | lamps within | eyes, inwards | eyes, outwards | hits lost |"
    yield "|---|---:|---:|---:|---:|---:|"

    def shown(count: Count) -> str:
        return f"{count.wrong} / {count.rays:,}"

    for name in ON_WALLS:
        n = 2 if name == "ball" else 64
        with staged(name) as stage:
            looks = [eyes_on_walls(stage, inwards, n).wrong for inwards in (True, False)]
            cells = [lamps_on_walls(stage), light_from_within(name)]
            cells += [Count(len(wrong), int(wrong.sum())) for wrong in looks]
            row = [shown(count) for count in (*cells, eyes_on_walls_lose(stage))]
            if name == "thin":
                row[3] = "the outer face"
        yield f"| *{name.replace('_', ' ')}* | " + " | ".join(row) + " |"
    with staged("plain") as stage:
        share = eyes_on_walls(stage, True, near=0.0).wrong.mean()
    yield f"\nEyes that see from a depth of 0 on would see the wall that they are on in {share:.0%} of their rays (*plain*, inwards)."


def sums_section() -> Iterator[str]:
    """Very many hits in one pixel."""
    yield "\n## A million hits in one pixel\n"
    yield "| Hits | largest relative error |"
    yield "|---|---:|"
    for n in (10_000, 1_000_000):
        found, exact = mean_of_many(n)
        yield f"| {n:,}, unevenly bright, summed as frames are, against float64 (`tests/hard/test_sums.py`) | {np.abs(found / exact - 1).max():.1e} |"
    hits, value = million_hits()
    yield f"| {hits:,.0f} of one eye in one pixel of another, by the whole program (`tests/hard/test_reprojection.py`) | {np.abs(value / RIGHT - 1).max():.1e} |"


def streams_section() -> Iterator[str]:
    """Independence of scrambles."""
    found = all_chances(program)
    worst = min(found, key=lambda name: found[name])
    yield "\n## Random streams\n"
    yield "Scrambles of neighbours in pixels, frames, samples, seeds and dimensions are tested for independence:"
    yield "chi-squared of joint cells, correlation, and the shift between the two (`tests/support/streams.py`), by Holm's"
    yield f"rule over all tests. {len(pairs())} pairs of places, {len(found)} tests: {len(dependent(found))} fail. The smallest chance is {found[worst]:.1e}"
    yield f"({worst}); of that number of tests, {1 / len(found):.1e} is expected. Bad scrambles do fail:"
    yield "\n| Scramble | tests that fail |"
    yield "|---|---:|"
    with np.errstate(over="ignore"):
        for words in bad.BAD:
            text = (inspect.getdoc(words) or "").rstrip(".")
            yield f"| {text[0].lower()}{text[1:]} | {len(dependent(all_chances(words)))} |"


SECTIONS = (rooms_section, walls_section, lambda: iter([CASES.rstrip("\n")]), sums_section, streams_section)

if __name__ == "__main__":
    lines = [line for section in SECTIONS for line in section()]
    publish(Path(sys.argv[1]), HEAD + "\n".join(lines) + "\n")
