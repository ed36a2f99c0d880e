"""Views that the page offers: OpenColorIO writes each as a shader of WebGL 2, with its tables.

    views/KEY.json   name, the shader's text, and the size of each table
    views/KEY.bin    the values of all tables, one after another: float32, little-endian

The key is a digest of both, so a browser that keeps files keeps the right ones.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.errors import JobError
from framearray_cli.base.hashing import line_digest

from ..display import SRGB, View

VIEWS_FOLDER = "views"
FUNCTION = "to_screen"  # in the shader: vec4 to_screen(vec4 radiance)
LABELS = {"srgb": "sRGB", "aces": "ACES 2.0"}
WIDEST = 2048  # of tables, texels: what WebGL 2 promises


@dataclass(frozen=True, slots=True)
class PageViews:
    """Views of one page, the one that it starts with first; none: it has the sRGB curve, and no choice.

    Attributes:
        table: of `contents.json`: name, label, and the key of the files; without files for the sRGB curve.
        files: name relative to the page -> content.
    """

    table: tuple[dict[str, str], ...] = ()
    files: dict[str, bytes] = field(default_factory=dict)


def page_views(views: Sequence[View]) -> PageViews:
    """Write the files of views; the sRGB curve is always among them, last if it is not given.

    Raises:
        JobError: OpenColorIO cannot write a view as a shader.
    """
    if not views:
        return PageViews()
    table: list[dict[str, str]] = []
    files: dict[str, bytes] = {}
    for view in dict.fromkeys([*views, SRGB]):
        row = {"name": view.name, "label": LABELS.get(view.name, view.name)}
        if not view.is_srgb:
            head, values = _shader(view)
            key = line_digest(head + values).decode()
            row["file"] = f"{VIEWS_FOLDER}/{key}"
            files |= {f"{VIEWS_FOLDER}/{key}.json": head, f"{VIEWS_FOLDER}/{key}.bin": values}
        table.append(row)
    return PageViews(tuple(table), files)


def _shader(view: View) -> tuple[bytes, bytes]:
    """Return the files of a view."""
    import PyOpenColorIO as ocio

    shader = ocio.GpuShaderDesc.CreateShaderDesc(
        language=ocio.GPU_LANGUAGE_GLSL_ES_3_0, functionName=FUNCTION, resourcePrefix="view_"
    )
    shader.setAllowTexture1D(False)  # WebGL has none
    shader.setTextureMaxWidth(WIDEST)
    try:
        view.processor.getDefaultGPUProcessor().extractGpuShaderInfo(shader)
    except ocio.Exception as error:
        raise JobError("--view", [f"{view.name}: OpenColorIO writes no shader: {error}"]) from error
    tables: list[dict[str, Any]] = []
    values: list[NDArray[np.float32]] = []
    for one in shader.getTextures():
        channels = 1 if one.channel == ocio.GpuShaderDesc.TEXTURE_RED_CHANNEL else 3
        smooth = one.interpolation != ocio.INTERP_NEAREST
        size = [one.width, one.height]
        tables.append({"sampler": one.samplerName, "size": size, "channels": channels, "smooth": smooth})
        values.append(np.asarray(one.getValues(), "<f4"))
    for one in shader.get3DTextures():
        smooth = one.interpolation != ocio.INTERP_NEAREST  # the shader interpolates in tetrahedra itself
        tables.append({"sampler": one.samplerName, "size": [one.edgeLen] * 3, "channels": 3, "smooth": smooth})
        values.append(np.asarray(one.getValues(), "<f4"))
    head = {"name": view.name, "text": shader.getShaderText(), "tables": tables}
    return json.dumps(head).encode(), b"".join(one.tobytes() for one in values)
