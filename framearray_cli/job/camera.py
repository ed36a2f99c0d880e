"""`[camera]`: the path of the camera, and its lens, for all frames or per key."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Literal, TypeAlias

from pydantic import Field, ValidationInfo, field_validator, model_validator

from framearray_cli.base.forms.table import Float3, Place, Problems, Table, fail, fill, optional, refuse
from framearray_cli.base.forms.words import shown
from framearray_cli.base.lens import ORTHOGRAPHIC, PANORAMA, PERSPECTIVE

from .keys import MOST_EYES, key_problems, keys_or_file
from .values import Direction, FileName, LensShift, Point, Size

PANORAMA_SIZE = (400, 200)
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
FieldOfView: TypeAlias = Annotated[float, Field(ge=LEAST_FOV, le=MOST_FOV)]
Height: TypeAlias = Annotated[float, Field(ge=LEAST_HEIGHT, le=MOST_HEIGHT)]
PixelAspect: TypeAlias = Annotated[float, Field(ge=0.01, le=100.0)]
OF_FRAME = " Given at every key or at none."


class CameraKey(Table):
    """Camera position at one frame, optionally with its lens.

    Attributes:
        frame: Number of the camera position, counted from 0.
        eye: Position of the camera, in the coordinates of the scene file.
        target: Point in the middle of the picture, in the coordinates of the scene file.
        up: Upward direction in the picture. Given at every key or at none.
        fov: Vertical field of view, degrees. Given at every key or at none.
        height: Height of what an orthographic camera sees, scene units. Given at every key or at none.
        shift: Lens shift, as in `[camera]`. Given at every key or at none.
        pixel_aspect: Width of a pixel over its height. Given at every key or at none.
    """

    frame: int = Field(ge=0, lt=MOST_EYES)
    eye: Point
    target: Point
    up: Direction | None = optional("the scene's up axis")
    fov: FieldOfView | None = optional("the value of `[camera]`")
    height: Height | None = optional("the value of `[camera]`")
    shift: LensShift | None = optional("the value of `[camera]`")
    pixel_aspect: PixelAspect | None = optional("the value of `[camera]`")

    @field_validator("target")
    @classmethod
    def _differs_from_eye(cls, target: Float3, info: ValidationInfo) -> Float3:
        if target == info.data.get("eye"):
            fail([((), f"expected a point other than `eye`, got {shown(target)}, the same")])
        return target


class CameraTable(Table):
    """The path of the camera: one camera position per frame.

    Attributes:
        type: "orthographic": parallel rays, sizes do not depend on the distance. "panorama": 360 x 180 degrees,
            equirectangular; its middle looks at the target.
        resolution: Width and height of every image, pixels. A panorama is twice as wide as high.
        fov: Vertical field of view of a perspective, degrees.
        height: Height of what an orthographic camera sees, scene units; the width follows from the resolution.
        shift: Lens shift of the picture to the right and up, as a share of its longer side, as in Blender. [0, 0.2]
            shows more of a tower's top, and its edges stay vertical.
        pixel_aspect: Width of a pixel over its height.
        frames: Number of camera positions, N_c.
        file: File of camera positions, instead of `keys`: CSV, JSON or `transforms.json`.
        keys: Camera positions at some frames. The camera moves smoothly between keys, and rests before the first and
            after the last. One key: a fixed camera.
    """

    type: CameraType = "perspective"
    resolution: Size = optional("`[400, 300]`; `[400, 200]` of a panorama; or as in `file`", (400, 300))
    fov: FieldOfView = 60.0
    height: Height | None = optional("none")
    shift: LensShift | None = optional("`[0.0, 0.0]`")
    pixel_aspect: PixelAspect | None = optional("`1.0`")
    frames: int = optional("the last key's frame + 1, or the rows of `file`", 0, ge=1, le=MOST_EYES)
    file: FileName | None = optional("none")
    keys: tuple[CameraKey, ...] = optional(
        "the rows of `file`", (), {"minItems": 1}, strict=False, validate_default=True
    )

    @field_validator("keys")
    @classmethod
    def _consistent(cls, keys: tuple[CameraKey, ...], info: ValidationInfo) -> tuple[CameraKey, ...]:
        keys_or_file(keys, info)
        refuse(key_problems(keys, info.data.get("frames", 0), "up", "up", *LENS_KEYS))
        return keys

    def problems(self) -> Problems:
        """Check the lens, and the shape of a panorama."""
        yield from self._lens_problems(KEYS_OF_TYPE[self.type])
        width, height = self.resolution
        if self.type == PANORAMA and width != 2 * height and "resolution" in self.model_fields_set:
            wanted = f"twice as wide as high, [{2 * height}, {height}] or [{width}, {width // 2}]"
            yield ("resolution",), f"expected a panorama {wanted}, got [{width}, {height}]"

    @model_validator(mode="after")
    def _fill_in(self) -> "CameraTable":
        if self.type == PANORAMA and "resolution" not in self.model_fields_set:
            fill(self, "resolution", PANORAMA_SIZE)
        if "frames" not in self.model_fields_set and self.keys:
            fill(self, "frames", self.keys[-1].frame + 1)
        return self

    def _lens_problems(self, allowed: Sequence[str]) -> Problems:
        """Check that the table, or each of its keys, has the lens of its type."""
        given_at: list[Place] = []
        for name in LENS_KEYS:
            at = next((i for i, key in enumerate(self.keys) if getattr(key, name) is not None), None)
            given = name in self.model_fields_set and getattr(self, name) is not None
            places: list[Place] = [(name,)] if given else []
            places += [("keys", at, name)] if at is not None else []
            given_at += places
            if name not in allowed:
                owners = " and ".join(f'"{each}"' for each, names in KEYS_OF_TYPE.items() if name in names)
                text = f'expected none with type = "{self.type}"; it belongs to {owners}'
                yield from ((place, text) for place in places)
            elif len(places) > 1:
                yield (name,), f"expected either camera.{name} or {name} of every key, got both"
        if self.type == ORTHOGRAPHIC and not any(place[-1] == "height" for place in given_at) and self.keys:
            yield ("height",), "missing; give the height of what an orthographic camera sees, scene units"
