"""Scene files -> triangles, materials, textures, cameras and lights. The only door to trimesh.

Errors of any reader become one SceneError, and libraries print nothing on the way.
"""

import logging
import warnings
from collections.abc import Container, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from framearray_cli.base.errors import SceneError
from framearray_cli.base.extras import install_command
from framearray_cli.base.forms.toml import mistaken
from framearray_cli.base.units import counted

from .assets import AssetError, Assets, Limit
from .gltf.container import open_gltf
from .gltf.meshes import read_gltf
from .gltf.stage import read_gltf_stage
from .ifc import SUFFIXES as IFC_SUFFIXES
from .ifc import read_ifc, read_ifc_stage
from .model import Material, Meshes, Notes, Part
from .obj import read_obj
from .other import other_stage, read_other
from .staging import Stage, StageCamera, StageLens, StageLight
from .textures import KEPT
from .usd.meshes import read_usd
from .usd.stage import read_usd_stage
from .usd.usdcore import SUFFIXES

__all__ = [
    "Material",
    "Meshes",
    "Notes",
    "Part",
    "Stage",
    "StageCamera",
    "StageLens",
    "StageLight",
    "read_meshes",
    "read_stage",
]

LOGGERS = ("trimesh", "PIL")
# Not reported: the limit counts what images take, and a note names each texture that is left out.
SILENT_WARNINGS = ("DeprecationWarning", "DecompressionBombWarning")
SILENT_MESSAGES = ("unable to load image!",)
ESCAPED = "; in double quotes TOML reads a backslash as an escape, such as \\n and \\t; write / for it"
MAX_REASON = 200  # characters of a library's own message that an error repeats


def read_meshes(
    file: Path,
    folders: Sequence[Path] = (),
    memory: int | None = None,
    shining: Container[str] = (),
    *,
    as_file: bool = False,
    all_uvs: bool = False,
    time: float | None = None,
) -> Meshes:
    """Read a scene file of any format.

    Args:
        folders: where files that the scene names may lie, besides its own folder.
        memory: bytes that reading may take; None: all that are free.
        shining: names of the materials whose emission is read.
        as_file, all_uvs, time: see `Assets`.

    Raises:
        SceneError: the file is missing, a folder, of an unknown kind, broken, without triangles or too large, or names
            files elsewhere.
    """
    limit = Limit() if memory is None else Limit(most=memory)
    assets = Assets(
        folder=file.parent,
        folders=tuple(folders),
        limit=limit,
        shining=shining,
        as_file=as_file,
        all_uvs=all_uvs,
        time=time,
    )
    extension = file.suffix[1:].lower()
    with _quiet() as messages, np.errstate(all="ignore"), _scene_errors(file, extension):
        meshes = _read(file, extension, assets)
        if as_file:  # for their smaller copies
            assets.limit.take("textures", KEPT * sum(t.shape[0] * t.shape[1] for t in meshes.textures) // 3)
        assets.require_inside()
    if not any(len(part.corners) for part in meshes.parts):
        found = "; ".join(
            (*meshes.notes, *(f"{counted(n, 'triangle')} with {why}" for why, n in meshes.dropped.items()))
        )
        raise SceneError(f"{file}: expected triangles, got none" + (f" ({found})" if found else ""))
    messages = [*assets.renamed_notes(), *(f"while reading: {message}" for message in messages)]
    return replace(meshes, notes=(*meshes.notes, *messages))


def read_stage(file: Path, folders: Sequence[Path] = ()) -> Stage:
    """Read the cameras and lights of a scene file; only glTF and USD have some that are read.

    Args:
        folders: see `read_meshes`.

    Raises:
        SceneError: the file is missing, a folder, or broken.
    """
    extension = file.suffix[1:].lower()
    if extension not in ("glb", "gltf", "dae", "3mf", *SUFFIXES, *IFC_SUFFIXES):
        return Stage()
    assets = Assets(folder=file.parent, folders=tuple(folders))
    with np.errstate(all="ignore"), _scene_errors(file, extension):
        data = _bytes_of(file, assets.limit)
        if extension in IFC_SUFFIXES:
            return read_ifc_stage(file)
        if extension in ("dae", "3mf"):
            return other_stage(data, extension)
        usd = extension in SUFFIXES
        stage = read_usd_stage(file, assets) if usd else read_gltf_stage(open_gltf(data, assets))
    return replace(stage, notes=(*stage.notes, *assets.renamed_notes()))


@contextmanager
def _scene_errors(file: Path, extension: str) -> Iterator[None]:
    """Turn any error of the readers into a SceneError that names the file."""
    try:
        yield
    except Exception as error:  # broken files make readers raise anything
        name = str(file).replace("\n", "\\n")
        raise SceneError(f"{name}: {_reason(error, extension.upper())}") from error


def _reason(error: Exception, kind: str) -> str:
    match error:
        case SceneError() | AssetError():
            return str(error)
        case ImportError():
            package = "Pillow" if (error.name or "").startswith("PIL") else str(error.name)
            return f"reading it needs {package}; install it with: {install_command(package)}"
        case MemoryError():
            return "does not fit into memory, or its header claims more than it holds"
        case UnicodeDecodeError():
            return f"broken, or not {kind} (it is no text); export it anew"
    prefix = "" if type(error) is ValueError and str(error) else f"{type(error).__name__}: "
    reason = " ".join(f"{prefix}{error}".split())[:MAX_REASON].rstrip(" :")
    return f"broken, or not {kind} ({reason}); export it anew"


def _bytes_of(file: Path, limit: Limit) -> bytes:
    """Read the bytes of a scene file; none of USD and IFC, whose libraries read the file themselves.

    Pipes and devices are refused, too, which may never end.
    """
    try:
        if not file.exists():
            odd = "" if str(file).isprintable() else ESCAPED
            raise SceneError(f"no such scene file; paths are relative to the job file{odd}")
        if problem := mistaken(file, "scene"):
            raise SceneError(problem)
        if file.is_dir():
            raise SceneError("expected a scene file, got a folder")
        if not file.is_file():
            raise SceneError("expected a scene file, got a pipe or a device")
        size = file.stat().st_size
        if not size:
            raise SceneError("expected a scene, got an empty file")
        limit.take("files", size)
        return b"" if file.suffix[1:].lower() in (*SUFFIXES, *IFC_SUFFIXES) else file.read_bytes()
    except OSError as error:
        raise SceneError(f"cannot be read: {error.strerror or error}") from error


def _read(file: Path, extension: str, assets: Assets) -> Meshes:
    data = _bytes_of(file, assets.limit)
    if extension in SUFFIXES:
        return read_usd(file, assets)
    if extension in IFC_SUFFIXES:
        return read_ifc(file, assets)
    if extension in ("glb", "gltf"):
        return read_gltf(data, assets)
    return read_obj(data, assets) if extension == "obj" else read_other(data, file, assets)


@contextmanager
def _quiet() -> Iterator[list[str]]:
    """Collect the messages that libraries log or warn with, each once, instead of printing them."""
    messages: list[str] = []

    class Collect(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            note = record.getMessage()
            if note not in (*messages, *SILENT_MESSAGES):
                messages.append(note)

    handler = Collect(level=logging.WARNING)
    loggers = [logging.getLogger(name) for name in LOGGERS]
    propagate = [logger.propagate for logger in loggers]
    for logger in loggers:
        logger.addHandler(handler)
        logger.propagate = False
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            yield messages
        for warning in caught:
            text = " ".join(str(warning.message).split())
            if text not in messages and warning.category.__name__ not in SILENT_WARNINGS:
                messages.append(text)
    finally:
        for logger, before in zip(loggers, propagate, strict=True):
            logger.removeHandler(handler)
            logger.propagate = before
