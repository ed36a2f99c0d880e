# ruff: noqa: E501 - rows of tables
"""Writes docs/hard-cases.md: shadow rays with a known answer in rooms that are hard to trace, and how many were wrong.

PYTHONPATH=tests python tests/hard/report.py docs/hard-cases.md
"""

import inspect
import sys
from collections.abc import Iterator
from pathlib import Path

from rooms import ROOMS, count
from test_light_in_closed_rooms import allowed
from test_pictures_of_hard_cases import FLIPPED, ROUNDING

HITS = 50_000
# Name of the column, unit of length, and how far away the room is.
PLACES = (
    ("as it is", 1.0, 0.0),
    ("times 1e-6", 1e-6, 0.0),
    ("times 1e6", 1e6, 0.0),
    ("moved by 1e7", 1.0, 1e7),
)

HEAD = f"""# Hard cases

Written by `PYTHONPATH=tests python tests/hard/report.py docs/hard-cases.md`; `tests/hard/` tests all of it.

## Light in closed rooms

Every room is closed and convex: from inside, a lamp inside reaches every point of the walls, and a lamp outside none.
So the answer of each shadow ray is known. {HITS:,} points of each room, five lamps inside and five outside: a quarter
of a million rays each. A cell gives leaks (light from outside) / false shadows (of lamps inside).
"""

TAIL = f"""
In the wedge, points nearer to its edge than rays start above a surface, divided by the tangent of a degree, lie behind
the other wall for such a ray: at most {allowed("wedge", 5 * HITS)} of {5 * HITS:,} false shadows are allowed for that.

## Pictures

`tests/hard/test_pictures_of_hard_cases.py` renders a room with mirrors and textures, and asks that the picture is the
same, or sound.

| Case | What must hold |
|---|---|
| all lengths times 1e-6 to 1e6; moved by 1e7 | fewer than {FLIPPED:.0%} of the pixels differ by more than {ROUNDING:g} of the mean: samples that pass an edge on its other side |
| intensities times 1e-12 to 1e12 | all values in proportion, to 1e-5 |
| fields of view of 1 and 170 degrees | all values finite, none below 0 |
| ranges of obscurance from 1e-9 to 1e12 | W is the average reflectivity, or goes to 0 |
| reflectivity 0 and 1, in a closed room too | black, or finite |
| a lamp on a floor, a wall, a vertex, at an eye, inside a mesh | light of the first four arrives; that of the last stays inside |
| a sun parallel to walls | they get exactly nothing |
| an eye on a surface, in a closed box, looking along up | what a point there sees. An eye exactly on a surface sees that surface, from the side that it looks from |
| equal eyes in a row, with both weights | pictures as close as their windows have hits in common |
| facing mirrors of reflectivity 1, 16 bounces | nothing brighter than the background |
| a million hits in one pixel | sums in float32 within 1e-4 of float64 |
"""


def rows() -> Iterator[str]:
    """The table of closed rooms."""
    yield "| Room | " + " | ".join(name for name, _, _ in PLACES) + " |"
    yield "|---|" + "---:|" * len(PLACES)
    for name, room in ROOMS.items():
        cells = []
        for _, size, at in PLACES:
            leaks, shadows = count(name, size=size, at=(at, -at, at), n=HITS)
            cells.append(f"{leaks.wrong} / {shadows.wrong}")
        about = (inspect.getdoc(room) or "").split(":")[0].rstrip(".")
        yield f"| *{name.replace('_', ' ')}*: {about[0].lower()}{about[1:]} | " + " | ".join(cells) + " |"


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(HEAD + "\n" + "\n".join(rows()) + "\n" + TAIL, encoding="utf-8")
