"""`[camera]`: the path of the camera."""

from pydantic import Field, ValidationInfo, field_validator, model_validator

from framearray_cli.base.forms.table import Float3, Table, default_text, fail, fill
from framearray_cli.base.forms.words import shown

from .keys import MOST_EYES, key_problems, late_key_problems
from .values import Direction, FileName, Point, Size


class CameraKey(Table):
    """Where the camera is at one frame."""

    frame: int = Field(ge=0, lt=MOST_EYES, description="Number of the camera position, counted from 0.")
    eye: Point = Field(description="Point that the camera looks from, in the coordinates of the scene file.")
    target: Point = Field(description="Point that the camera looks at, in the coordinates of the scene file.")
    up: Direction | None = Field(
        default=None,
        description="Direction that is up in the picture. Given at every key or at none.",
        json_schema_extra=default_text("the scene's up axis"),
    )

    @field_validator("target")
    @classmethod
    def _differs_from_eye(cls, target: Float3, info: ValidationInfo) -> Float3:
        if target == info.data.get("eye"):
            fail([((), f"expected a point other than `eye`, got {shown(target)}, the same")])
        return target


class CameraTable(Table):
    """The path of the camera: one camera position per frame."""

    resolution: Size = Field(default=(400, 300), description="Width and height of every image, pixels.")
    fov: float = Field(default=60.0, ge=1e-3, le=179.9, description="Vertical field of view, degrees.")
    frames: int = Field(
        default=0,
        ge=1,
        le=MOST_EYES,
        description="Number of camera positions, N_c.",
        json_schema_extra=default_text("the last key's frame + 1, or the rows of `file`"),
    )
    file: FileName | None = Field(
        default=None,
        description="CSV or JSON file with one camera position per row, instead of `keys`.",
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
        if problems := key_problems(keys, "up", "up") + late_key_problems(keys, info.data.get("frames", 0)):
            fail(problems)
        return keys

    @model_validator(mode="after")
    def _fill_frames(self) -> "CameraTable":
        if "frames" not in self.model_fields_set and self.keys:
            fill(self, "frames", self.keys[-1].frame + 1)
        return self
