"""A scene file -> Meshes, or one SceneError; nothing is printed on the way."""

import logging
import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import SceneError
from .assets import AssetError, Assets
from .container import open_gltf
from .gltf import read_gltf
from .gltf_prepare import check_readable
from .gltf_stage import Stage, read_gltf_stage
from .model import Meshes
from .obj import read_obj
from .other import read_other, readable_formats

LOGGERS = ("trimesh", "PIL")
MAX_REASON = 200  # characters of a library's own message that an error repeats


def read_meshes(file: Path) -> Meshes:
    """Read a scene file of any format.

    Raises:
        SceneError: missing, a folder, of an unknown kind, broken, or without triangles.
    """
    data = _bytes_of(file)
    extension = file.suffix[1:].lower()
    with _quiet() as messages, np.errstate(all="ignore"), _told(file, extension):
        meshes = _read(data, extension, Assets(folder=file.parent))
    if not any(len(part.corners) for part in meshes.parts):
        found = "; ".join((*meshes.notes, *(f"{n} triangles with {why}" for why, n in meshes.dropped.items())))
        raise SceneError(f"{file}: expected triangles, got none" + (f" ({found})" if found else ""))
    return replace(meshes, notes=meshes.notes + tuple(f"while reading: {message}" for message in messages))


def read_stage(file: Path) -> Stage:
    """Read the cameras and lights of a scene file; only glTF has any that are read.

    Raises:
        SceneError: missing, a folder, or broken.
    """
    extension = file.suffix[1:].lower()
    if extension not in ("glb", "gltf"):
        return Stage()
    data = _bytes_of(file)
    with np.errstate(all="ignore"), _told(file, extension):
        gltf = open_gltf(data, Assets(folder=file.parent))
        check_readable(gltf)
        return read_gltf_stage(gltf)


@contextmanager
def _told(file: Path, extension: str) -> Iterator[None]:
    """Turn whatever readers raise into a SceneError that names the file."""
    try:
        yield
    except SceneError as error:
        raise SceneError(f"{file}: {error}") from error
    except ImportError as error:
        package = "Pillow" if (error.name or "").startswith("PIL") else error.name
        raise SceneError(f"{file}: reading it needs {package}; pip install {package}") from error
    except MemoryError as error:
        raise SceneError(f"{file}: does not fit into memory, or its header claims more than it holds") from error
    except AssetError as error:
        raise SceneError(f"{file}: {error}") from error
    except Exception as error:  # readers of broken files raise whatever comes first
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:MAX_REASON].rstrip(" :")
        raise SceneError(f"{file}: broken, or not {extension.upper()} ({reason}); export it anew") from error


def _bytes_of(file: Path) -> bytes:
    if os.path.isdir(file):
        raise SceneError(f"{file}: expected a scene file, got a folder")
    try:
        data = file.read_bytes()
    except FileNotFoundError as error:
        raise SceneError(f"{file}: no such scene file; paths are relative to the job file") from error
    except OSError as error:
        raise SceneError(f"{file}: cannot be read: {error.strerror or error}") from error
    if not data:
        raise SceneError(f"{file}: expected a scene, got an empty file")
    return data


def _read(data: bytes, extension: str, assets: Assets) -> Meshes:
    import PIL.Image  # noqa: F401  (trimesh reads no texture without it, and does not say so)

    if extension in ("glb", "gltf"):
        return read_gltf(data, assets)
    if extension == "obj":
        return read_obj(data, assets)
    known = readable_formats()
    if extension not in known:
        formats = ", ".join(sorted(known))
        raise SceneError(f"expected a scene of a known format, got '.{extension}'; known are {formats}")
    return read_other(data, extension, assets)


@contextmanager
def _quiet() -> Iterator[list[str]]:
    """Collect what the libraries log or warn of, each message once, instead of printing it."""
    messages: list[str] = []

    class Collect(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            note = record.getMessage()
            if note not in messages:
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
            if text not in messages and not issubclass(warning.category, DeprecationWarning):
                messages.append(text)
    finally:
        for logger, before in zip(loggers, propagate, strict=True):
            logger.removeHandler(handler)
            logger.propagate = before
