"""Reference page and JSON Schema of the job file: `make docs` writes both."""

import json
import sys
from collections.abc import Iterator
from pathlib import Path

from framearray_cli.base.forms.schema import Schema, Section, allowed_values, file_schema, sections
from framearray_cli.base.forms.toml import inline
from framearray_cli.job.job import Job, job_schema

EXAMPLE = """\
#:schema job.schema.json
name = "room"

[scene]
file = "scenes/room.glb"

[camera]
resolution = [400, 300]
fov = 60.0
keys = [
  { frame = 0,  eye = [0.0, 1.6, 3.0], target = [0.0, 1.2, 0.0] },
  { frame = 95, eye = [2.0, 1.6, 0.5], target = [0.0, 1.2, 0.0] },
]

[[light.sources]]
type = "point"
keys = [
  { frame = 0,  position = [1.0, 2.2, 0.0],  intensity = [10.0, 10.0, 9.0] },
  { frame = 47, position = [-1.0, 2.2, 0.0], intensity = [10.0, 10.0, 9.0] },
]
"""

INTRODUCTION = f"""\
# The job file

<!-- Made by `make docs` from framearray_cli/job/job.py; edit there. -->

A job file describes a scene, a camera path, a light path, and settings. It is written in
[TOML](https://toml.io). This is a whole job of 96 camera positions and 48 light positions:

```toml
{EXAMPLE}```

File names are relative to the folder of the job file. Positions and directions are in the coordinates of the scene
file. Colours are linear, with Rec. 709 primaries. An unknown key is an error, and the program reports all problems of a
file at once.

[job.schema.json](job.schema.json) is the same reference for editors: an editor with a TOML plugin, such as Taplo,
completes and checks a job file whose first line names it, as above.
"""

EYE_FILE = """\
A `file` of camera positions replaces `keys`. As CSV it starts with a row that names the columns, in any order; you may
leave out the `up_` columns:

```csv
eye_x,eye_y,eye_z,target_x,target_y,target_z,up_x,up_y,up_z
0.0,1.6,3.0,0.0,1.2,0.0,0.0,1.0,0.0
0.1,1.6,2.9,0.0,1.2,0.0,0.0,1.0,0.0
```

Further columns are for the lens: `fov`, `height`, `shift_x,shift_y`, `pixel_aspect`. As JSON it is a list:
`[{"eye": [0.0, 1.6, 3.0], "target": [0.0, 1.2, 0.0]}, ...]`, with `"up"` and the keys of the lens where wanted.
The first row is camera position 0, the next 1, and so on.

A `transforms.json` gives poses and lenses: [Cameras](../guide/cameras.md#positions-from-a-file).
"""

POSITION_FILE = """\
A `file` of light positions replaces `keys` of points, spots, panels and directional sources. Row k is light position k,
from 0.

- `.csv`: a row that names the columns, in any order: `x,y,z`; or `position_x,...` or `direction_x,...`, as in keys.
  Optionally the strength, as `intensity` or `intensity_r,intensity_g,intensity_b`; `color` (a factor or `3200 K`) or
  `color_r,color_g,color_b`; and what else the keys of that type have: `radius`, `target_x,target_y,target_z`, `width`.
- `.json`: a list of `[x, y, z]`, or of keys without `frame`: `[{"position": [0, 2, 1], "intensity": 5}, ...]`.
- `.npy`: a NumPy array of n x 3 numbers.

x, y and z are the position of a lamp, and for a directional source the direction from the object to the light, against
the `direction` of keys. In reflectance imaging they are in the axes of the picture: give `space = "camera"`, which
turns targets and directions, too. Values that a file lacks stand next to `file` and apply to
all positions: a strength, `color`, the size, and the aim of a spot or panel.

```toml
[[light.sources]]
type = "directional"
file = "dome.csv"
space = "camera"
irradiance = 3.0
```

The resolved job in the manifest has keys instead of the file.
"""


_MORE = {("camera", None): EYE_FILE, ("light.sources[]", "directional"): POSITION_FILE}


def reference_page() -> str:
    """Write the reference page, in Markdown."""
    root = file_schema(Job)
    return "\n".join([INTRODUCTION, *(_section(root, section) for section in sections(root))])


def schema_text() -> str:
    """Write the JSON Schema as it is published."""
    return json.dumps(job_schema(), indent=2, ensure_ascii=False) + "\n"


def _section(root: Schema, section: Section) -> str:
    """Describe one table: a heading, its meaning, and a row for each key that is not a table."""
    rows = list(_rows(root, section))
    if not rows:
        return ""
    about = section.schema.get("description", "") if section.place else "The keys before the first table."
    table = ["| key | value | default | meaning |", "|---|---|---|---|", *rows]
    more = [_MORE[place]] if (place := (section.place, section.kind)) in _MORE else []
    return "\n".join([f"## {_heading(section)}", "", about, "", *table, "", *more])


def _heading(section: Section) -> str:
    """Write the heading of a table: its place in a file."""
    kind = f" of type `{section.kind}`" if section.kind else ""
    place = section.place
    if not place:
        return "At the top"
    if place.endswith(".keys[]"):
        owner = place.removesuffix(".keys[]")
        return f"One of `keys` in `{_bracketed(owner)}`{kind}"
    return f"`{_bracketed(place)}`{kind}"


def _bracketed(place: str) -> str:
    """Write a place as a TOML table header: [camera], or [[light.sources]] for a list of tables."""
    return f"[[{place.removesuffix('[]')}]]" if place.endswith("[]") else f"[{place}]"


def _rows(root: Schema, section: Section) -> Iterator[str]:
    """Describe each key of a table that holds a value."""
    required = section.schema.get("required", ())
    for key, node in section.keys.items():
        values = allowed_values(root, node)
        if values == "a table":
            continue
        default = "required" if key in required else node.get("x-default") or f"`{inline(node['default'])}`"
        cells = (f"`{key}`", values, default, node.get("description", ""))
        yield f"| {' | '.join(cell.replace('|', '&#124;') for cell in cells)} |"


def main(folder: Path) -> None:
    """Write both files into a folder."""
    (folder / "job-file.md").write_text(reference_page(), encoding="utf-8", newline="\n")
    (folder / "job.schema.json").write_text(schema_text(), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
