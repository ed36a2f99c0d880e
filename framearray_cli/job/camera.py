"""`[camera]`: the path of the camera."""

from pydantic import Field, ValidationInfo, field_validator, model_validator

from framearray_cli.base.forms.table import Float3, Table, default_text, fail, fill
from framearray_cli.base.forms.words import shown
from framearray_cli.base.lens import PANORAMA

from .keys import MOST_EYES, key_problems, late_key_problems
from .lens import LEAST_FOV, LEAST_HEIGHT, LENS_KEYS, MOST_FOV, MOST_HEIGHT, CameraType, lens_problems
from .values import Direction, FileName, LensShift, Point, Size

PANORAMA_SIZE = (400, 200)
OF_FRAME = " Given at every key or at none."


class CameraKey(Table):
    """Where the camera is at one frame, and if wanted its lens."""

    frame: int = Field(ge=0, lt=MOST_EYES, description="Number of the camera position, counted from 0.")
    eye: Point = Field(description="Point that the camera looks from, in the coordinates of the scene file.")
    target: Point = Field(description="Point that the camera looks at, in the coordinates of the scene file.")
    up: Direction | None = Field(
        default=None,
        description="Direction that is up in the picture. Given at every key or at none.",
        json_schema_extra=default_text("the scene's up axis"),
    )
    fov: float | None = Field(
        default=None,
        ge=LEAST_FOV,
        le=MOST_FOV,
        description="Vertical field of view, degrees." + OF_FRAME,
        json_schema_extra=default_text("that of `[camera]`"),
    )
    height: float | None = Field(
        default=None,
        ge=LEAST_HEIGHT,
        le=MOST_HEIGHT,
        description="Height of what an orthographic camera sees, scene units." + OF_FRAME,
        json_schema_extra=default_text("that of `[camera]`"),
    )
    shift: LensShift | None = Field(
        default=None,
        description="Lens shift, as in `[camera]`." + OF_FRAME,
        json_schema_extra=default_text("that of `[camera]`"),
    )
    pixel_aspect: float | None = Field(
        default=None,
        ge=0.01,
        le=100.0,
        description="Width of a pixel over its height." + OF_FRAME,
        json_schema_extra=default_text("that of `[camera]`"),
    )

    @field_validator("target")
    @classmethod
    def _differs_from_eye(cls, target: Float3, info: ValidationInfo) -> Float3:
        if target == info.data.get("eye"):
            fail([((), f"expected a point other than `eye`, got {shown(target)}, the same")])
        return target


class CameraTable(Table):
    """The path of the camera: one camera position per frame."""

    type: CameraType = Field(
        default="perspective",
        description='"orthographic": rays are parallel, so that sizes do not depend on the distance. "panorama": '
        "360 x 180 degrees, equirectangular; its middle looks at the target.",
    )
    resolution: Size = Field(
        default=(400, 300),
        description="Width and height of every image, pixels. A panorama is twice as wide as high.",
        json_schema_extra=default_text("`[400, 300]`; `[400, 200]` of a panorama; or that of `file`, if it says one"),
    )
    fov: float = Field(
        default=60.0, ge=LEAST_FOV, le=MOST_FOV, description="Vertical field of view of a perspective, degrees."
    )
    height: float | None = Field(
        default=None,
        ge=LEAST_HEIGHT,
        le=MOST_HEIGHT,
        description="Height of what an orthographic camera sees, scene units; the width follows from the resolution.",
        json_schema_extra=default_text("none"),
    )
    shift: LensShift | None = Field(
        default=None,
        description="Lens shift: how far the picture lies to the right of the axis and above it, as a share of its "
        "longer side, as in Blender. [0, 0.2] shows more of a tower's top, and its edges stay vertical.",
        json_schema_extra=default_text("`[0.0, 0.0]`"),
    )
    pixel_aspect: float | None = Field(
        default=None,
        ge=0.01,
        le=100.0,
        description="Width of a pixel over its height.",
        json_schema_extra=default_text("`1.0`"),
    )
    frames: int = Field(
        default=0,
        ge=1,
        le=MOST_EYES,
        description="Number of camera positions, N_c.",
        json_schema_extra=default_text("the last key's frame + 1, or the rows of `file`"),
    )
    file: FileName | None = Field(
        default=None,
        description="File of camera positions, instead of `keys`: CSV, JSON, `transforms.json`, COLMAP's `images.txt`, "
        "or the manifest of a frame array.",
        json_schema_extra=default_text("none"),
    )
    keys: tuple[CameraKey, ...] = Field(
        default=(),
        strict=False,
        validate_default=True,
        description="Where the camera is at some frames; between them it moves smoothly, before the first and after "
        "the last it stands still. One key: a fixed camera.",
        json_schema_extra={**default_text("the rows of `file`"), "minItems": 1},
    )

    @field_validator("keys")
    @classmethod
    def _consistent(cls, keys: tuple[CameraKey, ...], info: ValidationInfo) -> tuple[CameraKey, ...]:
        has_file = info.data.get("file") is not None
        if has_file and keys:
            fail([((), "expected either `keys` or `file`, got both")])
        if not keys and not has_file and "file" in info.data:
            fail([((), "expected a list of at least 1 table, got none; give `keys` or `file`")])
        if problems := key_problems(keys, "up", "up", *LENS_KEYS) + late_key_problems(keys, info.data.get("frames", 0)):
            fail(problems)
        return keys

    @model_validator(mode="after")
    def _fit_lens(self) -> "CameraTable":
        if self.type == PANORAMA and "resolution" not in self.model_fields_set:
            fill(self, "resolution", PANORAMA_SIZE)
        width, height = self.resolution
        problems = lens_problems(self.type, self, self.keys)
        if self.type == PANORAMA and width != 2 * height:
            wanted = f"twice as wide as high, [{2 * height}, {height}] or [{width}, {width // 2}]"
            problems.append((("resolution",), f"expected a panorama {wanted}, got [{width}, {height}]"))
        if problems:
            fail(problems)
        return self

    @model_validator(mode="after")
    def _fill_frames(self) -> "CameraTable":
        if "frames" not in self.model_fields_set and self.keys:
            fill(self, "frames", self.keys[-1].frame + 1)
        return self
