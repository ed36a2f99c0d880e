"""What reads each kind of file, and small whole files of that kind."""

import io
import json
import tempfile
import zipfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tomli_w
from bench.core.results import ROOT
from support import ifchouse, movies
from support.iesfiles import VARIANTS
from support.scenes import packed_quad, split_glb

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
from framearray_cli.array.manifest_toml import read_manifest, to_toml
from framearray_cli.array.record import FOLDER, read_records, seal
from framearray_cli.base.errors import FrameArrayError, OutputError
from framearray_cli.job.camera import read_eyes
from framearray_cli.job.ies import read_photometry
from framearray_cli.job.read import read_job
from framearray_cli.job.rowfile import RowFileError, read_positions
from framearray_cli.scene.files import read_stage
from framearray_cli.scene.paths.panorama import read_panorama
from framearray_cli.scene.scene import load_scene
from framearray_cli.starter.staged import convert_camera, convert_lights
from framearray_cli.tools.movie.pathfile import load_movie_path

from .. import jobseeds, sceneseeds, usdseeds
from . import mutators
from .mutators import Mutate

MEMORY = 1 << 30  # bytes that a scene may take: hostile headers ask for more
FINGERPRINT = "0" * 16
# What a reader may end with; everything else is a finding.
REFUSED = (FrameArrayError, RowFileError)


Read = Callable[[Path], object]


@dataclass(frozen=True)
class Reader:
    """How files of a kind are read.

    Attributes:
        name: of the file that the bytes under test become.
        read: reads that file, or raises one of `REFUSED`.
        seeds: bytes of files that are read without a complaint.
        mutate: what their bytes become, beside what libFuzzer does with them.
        beside: name -> bytes of files that lie beside it.
    """

    name: str
    read: Read
    seeds: Callable[[Path], list[bytes]]
    mutate: Mutate
    beside: Callable[[], dict[str, bytes]] = dict


def _scene(file: Path) -> object:
    return load_scene(file, memory=MEMORY, shining={"Floor", "Old"}, as_file=True)


def _scenes(suffix: str) -> Callable[[Path], list[bytes]]:
    def seeds(folder: Path) -> list[bytes]:
        return [seed.data for seed in sceneseeds.made_seeds(folder) if seed.suffix == suffix]

    return seeds


def _of_obj(file: Path) -> object:
    """The OBJ whose picture or library is the file under test."""
    return _scene(file.with_name("seed.obj"))


def _usd(suffix: str, mutate: Mutate) -> Reader:
    """Surfaces, and cameras and lights at a few times."""

    def read(file: Path) -> object:
        stage = read_stage(file)
        convert_lights(stage, None)
        for camera in stage.cameras:
            convert_camera(stage, camera, 3, 1.0)
        return _scene(file)

    return Reader(f"seed{suffix}", read, lambda folder: usdseeds.usd_seeds(suffix, folder), mutate, usdseeds.beside)


def _blob() -> dict[str, bytes]:
    with tempfile.TemporaryDirectory() as folder:
        return {"seed.bin": split_glb(sceneseeds.rich_glb(Path(folder)))[1], **_files()}


def _files() -> dict[str, bytes]:
    """An OBJ, its library and its picture, which other formats name, too."""
    texts = {"seed.obj": sceneseeds.OBJ.encode(), "seed.mtl": sceneseeds.MTL.encode()}
    return texts | {"seed.png": sceneseeds.picture()}


def _jobs(folder: Path) -> list[bytes]:
    scene = str(jobseeds.with_scene(folder))
    return [tomli_w.dumps(table).encode() for table in jobseeds.tables(scene).values()]


def _paths(folder: Path) -> list[bytes]:
    names = ("easing-movie.toml", "first-movie.toml", "relight-movie.toml")
    return [(ROOT / "jobs" / name).read_bytes() for name in names]


def _manifests(folder: Path) -> list[bytes]:
    plain, groups = movies.plain(folder / "plain", 3, 2, "png"), movies.grouped(folder / "groups", 2)
    return [to_toml(plain).encode(), to_toml(groups).encode()]


def _records(folder: Path) -> list[bytes]:
    head = {"fingerprint": FINGERPRINT, "cameras": "0-1", "processor": "any", "cells": ""}
    frame = {"c": 0, "lights": [0, 2], "files": {"a.c0000.l000.png": [10, "0" * 16]}, "seconds": 0.5, "hits": 2.0}
    return [b"\n".join(json.dumps(line).encode() for line in (head, {**frame, "c": c})) for c in (0, 1)]


def _read_records(file: Path) -> object:
    """Lines that have a right checksum: without it they are skipped, and nothing more is seen of the reader."""
    lines = []
    for line in file.read_bytes().split(b"\n"):
        try:
            table = json.loads(line)
        except (ValueError, RecursionError):
            table = None
        lines.append(seal(table) if isinstance(table, dict) else line)
    folder = file.parent / FOLDER
    folder.mkdir(exist_ok=True)
    (folder / "0-1.jsonl").write_bytes(b"\n".join(lines) + b"\n")
    return read_records(file.parent, FINGERPRINT)


def _positions(file: Path) -> object:
    """Positions of the first type of source that takes them."""
    for kind in ("point", "directional", "spot"):
        try:
            return read_positions(file, kind, {}, strong=True)
        except RowFileError:
            continue
    return read_positions(file, "rect", {}, strong=True)


def _texts(*seeds: str) -> Callable[[Path], list[bytes]]:
    return lambda folder: [seed.encode() for seed in seeds]


def _npy(folder: Path) -> list[bytes]:
    data = io.BytesIO()
    np.save(data, np.eye(3, dtype=np.float32))
    return [data.getvalue()]


def _sky(folder: Path) -> list[bytes]:
    write_image(folder / "sky.exr", np.full((4, 8, 3), 0.5, np.float32), ImageFormat(format="exr"))
    return [(folder / "sky.exr").read_bytes()]


def _pictures(kind: str, *modes: str) -> Callable[[Path], list[bytes]]:
    return lambda folder: [sceneseeds.picture(kind, mode) for mode in modes]


HDR = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 4\n" + bytes([100, 90, 80, 129]) * 8
MODEL = """<?xml version="1.0"?><model unit="meter" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">
<resources><object id="1" type="model"><mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/>
<vertex x="0" y="1" z="0"/><vertex x="0" y="0" z="1"/></vertices><triangles><triangle v1="0" v2="2" v3="1"/>
<triangle v1="0" v2="1" v3="3"/><triangle v1="0" v2="3" v3="2"/><triangle v1="1" v2="2" v3="3"/></triangles></mesh>
</object></resources><build><item objectid="1"/></build></model>"""


def _house(folder: Path) -> list[bytes]:
    return [ifchouse.house(folder / "seed.ifc").read_bytes()]


def _image(file: Path) -> object:
    """All that a program of ours asks of an image of an array."""
    if file.suffix == ".png":
        read_codes(file)
    image = read_image(file)
    with suppress(OutputError):  # most have no alpha
        return image, read_alpha(file)
    return image, None


def _images_of_arrays(suffix: Extension) -> Callable[[Path], list[bytes]]:
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


def _packed(file: Path) -> object:
    """The model under test in its archive: changes of packed bytes would only break the archive."""
    model, data = file.read_bytes(), io.BytesIO()
    with zipfile.ZipFile(data, "w") as archive:
        archive.writestr("3D/3dmodel.model", model)
    file.write_bytes(data.getvalue())
    return _scene(file)


EYES_CSV = "eye_x,eye_y,eye_z,target_x,target_y,target_z\n0,1,2,0,1,0\n0.5,1,2,0,1,0\n"
EYES_JSON = json.dumps([{"eye": [0, 1, 2], "target": [0, 1, 0], "up": [0, 1, 0]}] * 2)
ROWS_CSV = "x,y,z,intensity,color\n0,1,2,3.5,2700 K\n1,1,2,3.5,5000 K\n"
ROWS_JSON = json.dumps([{"position": [0, 1, 2], "intensity": 3.5, "target": [0, 0, 0]}] * 2)

POSE = [[1, 0, 0, 2], [0, 1, 0, 1], [0, 0, 1, 3], [0, 0, 0, 1]]
TRANSFORMS = json.dumps(
    {"camera_model": "OPENCV", "fl_x": 50, "fl_y": 51, "cx": 30, "cy": 20, "w": 64, "h": 48, "k1": 0}
    | {"frames": [{"transform_matrix": POSE}, {"transform_matrix": POSE[:3], "fl_x": 60, "camera": 1}]}
)
ANGLES = json.dumps({"camera_angle_x": 0.7, "frames": [{"file_path": "a.png", "transform_matrix": POSE}]})
AROUND = json.dumps({"camera_model": "EQUIRECTANGULAR", "frames": [{"transform_matrix": POSE}]})
SIZE = (64, 48)  # pixels that a job gives


READERS: dict[str, Reader] = {
    "job": Reader("job.toml", read_job, _jobs, mutators.text),
    "movie path": Reader("walk.toml", load_movie_path, _paths, mutators.text),
    "manifest": Reader("manifest.toml", read_manifest, _manifests, mutators.text),
    "records": Reader("lines.jsonl", _read_records, _records, mutators.lines_of_json),
    "eyes csv": Reader("eyes.csv", read_eyes, _texts(EYES_CSV), mutators.text),
    "eyes json": Reader("eyes.json", read_eyes, _texts(EYES_JSON), mutators.tree),
    "transforms": Reader(
        "transforms.json", lambda file: read_eyes(file, SIZE), _texts(TRANSFORMS, ANGLES, AROUND), mutators.tree
    ),
    "positions csv": Reader("dome.csv", _positions, _texts(ROWS_CSV), mutators.text),
    "positions json": Reader("dome.json", _positions, _texts(ROWS_JSON), mutators.tree),
    "positions npy": Reader("dome.npy", _positions, _npy, mutators.data),
    "ies": Reader("lamp.ies", read_photometry, _texts(*VARIANTS.values()), mutators.text),
    "glb": Reader("seed.glb", _scene, _scenes(".glb"), mutators.glb, _files),
    "gltf": Reader("seed.gltf", _scene, _scenes(".gltf"), mutators.tree, _blob),
    "obj": Reader("seed.obj", _scene, _scenes(".obj"), mutators.text, _files),
    "mtl": Reader("seed.mtl", _of_obj, _texts(sceneseeds.MTL), mutators.text, _files),
    "ply": Reader("seed.ply", _scene, _scenes(".ply"), mutators.text, _files),
    "stl": Reader("seed.stl", _scene, _scenes(".stl"), mutators.text),
    "off": Reader("seed.off", _scene, _scenes(".off"), mutators.text),
    "usda": _usd(".usda", mutators.text),
    "usdc": _usd(".usdc", mutators.data),
    "usdz": _usd(".usdz", mutators.data),
    "panorama exr": Reader("sky.exr", read_panorama, _sky, mutators.data),
    "panorama hdr": Reader("sky.hdr", read_panorama, lambda folder: [HDR], mutators.data),
    "layers exr": Reader("layers.exr", read_layers, _layers, mutators.data),
    **{
        f"image {suffix}": Reader(f"a.{suffix}", _image, _images_of_arrays(suffix), mutators.data)
        for suffix in ("exr", "tif", "png", "jpg")
    },
    # textures, by their content
    **{
        kind: Reader("seed.png", _of_obj, seeds, mutators.data, _files)
        for kind, seeds in {
            "png": _pictures("PNG", "RGBA", "RGB", "L", "P"),
            "jpeg": _pictures("JPEG", "RGB", "L"),
            "texture exr": _images_of_arrays("exr"),
            "texture webp": _pictures("WEBP", "RGBA", "RGB"),
            "texture avif": _pictures("AVIF", "RGBA", "RGB"),
            "texture tiff": _pictures("TIFF", "RGBA", "L", "P"),
        }.items()
    },
    # scenes that other libraries unpack: DracoPy, MaterialX, IfcOpenShell, and lxml and networkx
    "draco": Reader("seed.glb", _scene, lambda folder: [packed_quad().data()], mutators.data),
    "mtlx": Reader(
        "look.mtlx", lambda file: _scene(file.with_name("seed.usda")), _texts(usdseeds.MTLX), mutators.text,
        usdseeds.with_document,
    ),
    "ifc": Reader("seed.ifc", lambda file: (read_stage(file), _scene(file)), _house, mutators.text),
    "3mf": Reader("seed.3mf", _packed, _texts(MODEL), mutators.text),
}  # fmt: skip


def prepared(reader: Reader, folder: Path) -> Path:
    """Write what lies beside a file of that kind; returns where the file itself goes."""
    for name, data in reader.beside().items():
        (folder / name).write_bytes(data)
    return folder / reader.name


def seeds_of(reader: Reader, folder: Path) -> list[bytes]:
    """Whole files of that kind; a folder for what they are made in."""
    folder.mkdir(parents=True, exist_ok=True)
    return reader.seeds(folder)
