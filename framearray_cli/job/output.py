"""`[output]`: what is written, and where."""

from pathlib import Path
from typing import Literal

from pydantic import Field

from framearray_cli.base.forms.table import Table, default_text
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
