"""Metadata of an image file: attribute names and camera matrices as OpenEXR defines them.

Notation: matrices here act on columns, `camera_from_world @ point`. OpenEXR (Imath) multiplies rows from the left,
`point * M44f`, so `exr.py` stores each matrix transposed.
"""

from collections.abc import Mapping
from fractions import Fraction
from typing import TypeAlias

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.base.lens import ORTHOGRAPHIC, PANORAMA, PERSPECTIVE, Lens
from framearray_cli.base.units import frame_rate

# A (4, 4) array is a matrix that acts on columns; three floats are a point or a colour; a Fraction is a rational.
Attribute: TypeAlias = str | int | float | Fraction | tuple[float, float, float] | Float64
Attributes: TypeAlias = Mapping[str, Attribute]


def exr_camera_from_world(world_from_camera: Float64) -> Float64:
    """Return OpenEXR's worldToCamera: x right, y up, z along the view (left-handed, as in RenderMan).

    Args:
        world_from_camera: (4, 4) rigid; the camera looks along -z, y up.

    Returns:
        (4, 4), acts on columns.
    """
    turned = np.linalg.inv(np.asarray(world_from_camera, np.float64))
    turned[2] *= -1  # ours looks along -z
    return turned


def exr_ndc_from_world(world_from_camera: Float64, lens: Lens, width: int, height: int) -> Float64:
    """Return OpenEXR's worldToNDC: after division by w, (0, 0) is the upper left corner, (1, 1) the lower right.

    z / w is 1 - 1 / distance along the view, and of an orthographic camera the distance: the standard leaves z open,
    and this keeps the matrix invertible.

    Args:
        world_from_camera: (4, 4) rigid; the camera looks along -z, y up.
        lens: no panorama.
        width: pixels.
        height: pixels.

    Returns:
        (4, 4), acts on columns.
    """
    high = lens.height if lens.type == ORTHOGRAPHIC else 2 * np.tan(np.radians(lens.fov) / 2)
    half_height = high / 2  # of what is seen at distance 1
    half_width = half_height * width / height * lens.pixel_aspect
    across, down = 0.5 / half_width, -0.5 / half_height
    left, top = (at / side for at, side in zip(lens.centre((width, height)), (width, height), strict=True))
    if lens.type == ORTHOGRAPHIC:
        ndc_from_camera = np.array([[across, 0, 0, left], [0, down, 0, top], [0, 0, 1, 0], [0, 0, 0, 1]])
    else:
        ndc_from_camera = np.array([[across, 0, left, 0], [0, down, top, 0], [0, 0, 1, -1], [0, 0, 1, 0]])
    return np.asarray(ndc_from_camera @ exr_camera_from_world(world_from_camera))


def _lens_attributes(lens: Lens) -> dict[str, Attribute]:
    """Return what an image says of its lens."""
    if lens.type == PERSPECTIVE:
        found: dict[str, Attribute] = {"framearray:fov": float(lens.fov)}
    else:
        found = {"framearray:type": lens.type}
    found |= {"framearray:height": float(lens.height)} if lens.type == ORTHOGRAPHIC else {}
    if lens.shift != (0.0, 0.0):
        found |= {"framearray:shift_x": lens.shift[0], "framearray:shift_y": lens.shift[1]}
    return found | ({"PixelAspectRatio": lens.pixel_aspect} if lens.pixel_aspect != 1.0 else {})


def frame_attributes(
    *,
    world_from_camera: Float64,
    lens: Lens,
    resolution: tuple[int, int],
    fps: float | Fraction,
    c: int,
    l: int | None = None,
    group: str = "",
    software: str = "framearray",
) -> dict[str, Attribute]:
    """Return the attributes of the file of image [c, l], or of camera c where `l` is None.

    Args:
        world_from_camera: (4, 4), in the scene file's own coordinates; the camera looks along -z, y up.
        lens: of the camera; a panorama gets no worldToNDC, as no matrix projects like it.
        resolution: (width, height), pixels.
        fps: frames per second.
        c: camera index.
        l: light index.
        group: whose light the file holds, or the name of another stored part; "": all light.
        software: program and version.
    """
    attributes: dict[str, Attribute] = {
        "Software": software,
        "worldToCamera": exr_camera_from_world(world_from_camera),
        **({} if lens.type == PANORAMA else {"worldToNDC": exr_ndc_from_world(world_from_camera, lens, *resolution)}),
        "framesPerSecond": frame_rate(fps),
        "framearray:camera": c,
        **_lens_attributes(lens),
    }
    if l is not None:
        attributes["framearray:light"] = l
    if group:
        attributes["framearray:group"] = group
    return attributes
