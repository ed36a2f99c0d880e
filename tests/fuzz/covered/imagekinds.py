"""Images of arrays with their layers, textures that are no PNG or JPEG, and scenes that are packed."""

import io
import zipfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
from support.scenes import Glb

from framearray_cli.array.images import (
    Extension,
    ImageFormat,
    read_alpha,
    read_codes,
    read_image,
    read_layers,
    write_image,
    write_layers,
)
from framearray_cli.base.errors import OutputError

from .. import sceneseeds
from . import mutators
from .reader import Read, Reader

MODEL = """<?xml version="1.0"?><model unit="meter" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">
<resources><object id="1" type="model"><mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/>
<vertex x="0" y="1" z="0"/><vertex x="0" y="0" z="1"/></vertices><triangles><triangle v1="0" v2="2" v3="1"/>
<triangle v1="0" v2="1" v3="3"/><triangle v1="0" v2="3" v3="2"/><triangle v1="1" v2="2" v3="3"/></triangles></mesh>
</object></resources><build><item objectid="1"/></build></model>"""
TEXTURES = {"WEBP": ("RGBA", "RGB"), "AVIF": ("RGBA", "RGB"), "TIFF": ("RGBA", "L", "P")}


def image_kinds(scene: Read) -> dict[str, Reader]:
    """Kinds of images: of arrays, and of textures by their content."""
    found = {
        f"image {suffix}": Reader(f"a.{suffix}", _image, _images(suffix), mutators.data)
        for suffix in ("exr", "tif", "png", "jpg")
    }
    found["layers exr"] = Reader("layers.exr", read_layers, _layers, mutators.data)
    beside = {"seed.obj": sceneseeds.OBJ.encode(), "seed.mtl": sceneseeds.MTL.encode()}
    for kind in TEXTURES:
        found[f"texture {kind.lower()}"] = Reader(
            "seed.png", lambda file: scene(file.with_name("seed.obj")), _textures(kind), mutators.data, lambda: beside
        )
    return found


def packed_kinds(scene: Read) -> dict[str, Reader]:
    """Kinds of scenes whose meshes other libraries unpack: DracoPy, and lxml and networkx for 3MF."""
    return {
        "draco": Reader("seed.glb", scene, _draco, mutators.data),
        "3mf": Reader("seed.3mf", lambda file: _packed(file, scene), lambda folder: [MODEL.encode()], mutators.text),
    }


def _image(file: Path) -> object:
    """All that a program of ours asks of an image of an array."""
    if file.suffix == ".png":
        read_codes(file)
    image = read_image(file)
    with suppress(OutputError):  # most have no alpha
        return image, read_alpha(file)
    return image, None


def _images(suffix: Extension) -> Callable[[Path], list[bytes]]:
    def seeds(folder: Path) -> list[bytes]:
        file, found = folder / f"seed.{suffix}", []
        image = np.linspace(0, 2, 36, dtype=np.float32).reshape(3, 4, 3)
        for half in ("auto", "never") if suffix == "exr" else ("auto",):
            for alpha in (None, image[..., 0] / 2) if suffix != "jpg" else (None,):
                write_image(file, image, ImageFormat(format=suffix, half=half), alpha=alpha)
                found.append(file.read_bytes())
        return found

    return seeds


def _layers(folder: Path) -> list[bytes]:
    file, row = folder / "layers.exr", np.linspace(0, 2, 12, dtype=np.float32).reshape(3, 4)
    write_layers(file, {"depth.Z": row, **{f"normal.{axis}": row for axis in "XYZ"}})
    return [file.read_bytes()]


def _textures(kind: str) -> Callable[[Path], list[bytes]]:
    return lambda folder: [sceneseeds.picture(kind, mode) for mode in TEXTURES[kind]]


def _draco(folder: Path) -> list[bytes]:
    """A triangle whose mesh DracoPy packed."""
    import DracoPy

    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float64)
    data = DracoPy.encode(corners, faces=np.array([[0, 1, 2]]), preserve_order=True)
    glb = Glb()
    number = DracoPy.decode(data).attributes[0]["unique_id"]
    packed = {"bufferView": glb.view(data), "attributes": {"POSITION": number}}
    position = glb.add("accessors", {"componentType": 5126, "count": 3, "type": "VEC3"})
    indices = glb.add("accessors", {"componentType": 5123, "count": 3, "type": "SCALAR"})
    extension = {"extensions": {"KHR_draco_mesh_compression": packed}}
    primitive = {"attributes": {"POSITION": position}, "indices": indices} | extension
    glb.node(glb.add("meshes", {"primitives": [primitive]}))
    glb.tree["extensionsUsed"] = ["KHR_draco_mesh_compression"]
    return [glb.save(folder / "seed.glb").read_bytes()]


def _packed(file: Path, scene: Read) -> object:
    """The model under test in its archive: changes of packed bytes would only break the archive."""
    model, data = file.read_bytes(), io.BytesIO()
    with zipfile.ZipFile(data, "w") as archive:
        archive.writestr("3D/3dmodel.model", model)
    file.write_bytes(data.getvalue())
    return scene(file)
