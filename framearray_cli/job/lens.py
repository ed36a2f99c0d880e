"""Keys of the lens of a camera: for all frames in `[camera]`, or of each of its keys."""

from collections.abc import Mapping, Sequence
from typing import Any, Literal, TypeAlias

from framearray_cli.base.forms.table import Place, Table
from framearray_cli.base.lens import ORTHOGRAPHIC, PANORAMA, PERSPECTIVE

CameraType: TypeAlias = Literal["perspective", "orthographic", "panorama"]
LEAST_FOV, MOST_FOV = 1e-3, 179.9
LEAST_HEIGHT, MOST_HEIGHT = 1e-9, 1e15
LENS_KEYS = ("fov", "height", "shift", "pixel_aspect")
# The keys that cameras of each type have.
KEYS_OF_TYPE: Mapping[str, Sequence[str]] = {
    PERSPECTIVE: ("fov", "shift", "pixel_aspect"),
    ORTHOGRAPHIC: ("height", "shift", "pixel_aspect"),
    PANORAMA: (),
}


def lens_problems(kind: str, table: Table, keys: Sequence[Table]) -> list[tuple[Place, str]]:
    """Check the lens of a camera table and its keys against the type of the camera."""
    problems: list[tuple[Place, str]] = []
    own, allowed = table.model_fields_set, KEYS_OF_TYPE[kind]
    given_at: list[Place] = []
    for name in LENS_KEYS:
        at = next((i for i, key in enumerate(keys) if getattr(key, name) is not None), None)
        given = name in own and getattr(table, name) is not None
        places: list[Place] = [(name,)] if given else []
        places += [("keys", at, name)] if at is not None else []
        given_at += places
        if name not in allowed:
            owners = " and ".join(f'"{each}"' for each, names in KEYS_OF_TYPE.items() if name in names)
            problems += [(place, f'expected none with type = "{kind}"; it belongs to {owners}') for place in places]
        elif len(places) > 1:
            problems.append(((name,), f"expected either camera.{name} or {name} of every key, got both"))
    if kind == ORTHOGRAPHIC and not any(place[-1] == "height" for place in given_at) and keys:
        problems.append((("height",), "missing; give the height of what an orthographic camera sees, scene units"))
    return problems


def plain_lens(table: dict[str, Any]) -> None:
    """Take out of the plain table of a camera what says nothing, as in jobs of versions without these keys."""
    kind = table["type"]
    if kind == PERSPECTIVE:
        del table["type"]
    if "fov" not in KEYS_OF_TYPE[kind] or any("fov" in key for key in table["keys"]):
        table.pop("fov", None)
