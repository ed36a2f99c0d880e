"""`[output]`: what is written, and where."""

from pathlib import Path
from typing import Literal

from pydantic import Field, model_validator

from framearray_cli.base.forms.table import Place, Table, default_text, fail
from framearray_cli.base.units import LEAST_FPS, MOST_FPS, MOST_STOPS

from .values import FileName


class OutputTable(Table):
    """What is written."""

    directory: FileName = Field(
        default=Path(),
        description="Folder for images and manifest.",
        json_schema_extra=default_text('"../out/" and the job\'s name'),
    )
    format: Literal["exr", "png", "tif", "jpg"] = Field(
        default="exr",
        description="Image format. EXR and TIFF hold linear radiance; PNG and JPEG are sRGB, clipped to 0..1.",
    )
    fps: float = Field(
        default=24.0,
        ge=LEAST_FPS,
        le=MOST_FPS,
        description="Frames per second, stored in the images and used for movies.",
    )
    compression: Literal["none", "rle", "zip", "zips", "piz", "pxr24", "b44", "b44a", "dwaa", "dwab"] = Field(
        default="none",
        description="Compression of EXR. zip saves a third of the space and makes a render up to 1.6 times as long. "
        "pxr24, b44, b44a, dwaa and dwab lose precision.",
    )
    half: Literal["auto", "always", "never"] = Field(
        default="auto",
        description='EXR with 16 bits per channel. "auto": 32 bits for an image with values above 65504, which 16 bits '
        'cannot hold. "always": clip such values to 65504. "never": always 32 bits.',
    )
    quality: int = Field(default=95, ge=1, le=100, description="Quality of JPEG.")
    exposure: float = Field(
        default=0.0,
        ge=-MOST_STOPS,
        le=MOST_STOPS,
        description="Brightens PNG and JPEG by 2 to this power (stops). EXR and TIFF stay as they are.",
    )
    layers: bool = Field(
        default=True,
        description="Also write one multi-channel EXR per camera: obscurance, indirect, reflectivity, normal, depth, "
        "sample count.",
    )
    sun_hours: bool | None = Field(
        default=None,
        description="Also write hours of direct sun into the layers: a channel per day of the only source of type "
        '"sun", and one for all days.',
        json_schema_extra=default_text("false"),
    )
    alpha: bool | None = Field(
        default=None,
        description="Images with an alpha channel: what lies outside the scene is left out where the camera sees it, "
        "and alpha is the share of the pixel that the scene covers. Premultiplied in EXR and TIFF, not in PNG.",
        json_schema_extra=default_text("false"),
    )
    position: bool | None = Field(
        default=None,
        description="Also write positions of surfaces into the layers, in the scene file's own coordinates.",
        json_schema_extra=default_text("false"),
    )
    uv: bool | None = Field(
        default=None,
        description="Also write texture coordinates into the layers.",
        json_schema_extra=default_text("false"),
    )
    cryptomatte: bool | None = Field(
        default=None,
        description="Also write mattes of all objects and materials into the layers, as Cryptomatte.",
        json_schema_extra=default_text("false"),
    )

    @property
    def marks(self) -> dict[str, bool]:
        """Which layers beyond those of every job are wanted: mattes, position, uv."""
        wanted = {"mattes": self.cryptomatte, "position": self.position, "uv": self.uv}
        return {name: bool(value) and self.layers for name, value in wanted.items()}

    @model_validator(mode="after")
    def _check_layers(self) -> "OutputTable":
        problems: list[tuple[Place, str]] = []
        if self.alpha and self.format == "jpg":
            problems.append((("alpha",), 'expected format = "exr", "png" or "tif": JPEG has no alpha channel'))
        for key in ("position", "uv", "cryptomatte"):
            if getattr(self, key) and not self.layers:
                problems.append(((key,), "expected layers = true beside it, as it is a layer"))
        if problems:
            fail(problems)
        return self
