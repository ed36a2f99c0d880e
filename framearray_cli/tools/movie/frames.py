"""One image of a sequence: linked, or composed and converted; with the light of each group and the layers beside it."""

import os
import re
import shutil
from fractions import Fraction
from pathlib import Path

import numpy as np

from framearray_cli.array.cryptomatte import ATTRIBUTES
from framearray_cli.array.exr import Attribute, frame_attributes
from framearray_cli.array.images import (
    COLOUR_ID,
    FOR_SCREENS,
    SCENE_LIGHT,
    Extension,
    ImageFormat,
    format_name,
    read_image,
    read_layers,
    unassociated,
    write_codes,
    write_image,
    write_layers,
)
from framearray_cli.array.manifest import Manifest, layers_path
from framearray_cli.array.mixtures import Mixture
from framearray_cli.array.pictures import Pictures, Relight
from framearray_cli.base.arrays import Float32, Image
from framearray_cli.base.openimage import read_texts

from .look import Look, screen_codes, shot_label
from .timeline import Shot

LIGHT = "light_"  # begins the names of layers with the light of groups


def link_or_copy(source: Path, target: Path) -> None:
    """Give a file a second name, or copy it where the file system cannot link it."""
    try:
        target.hardlink_to(source)
    except (OSError, NotImplementedError):  # another disk, FAT, too many links
        shutil.copyfile(source, target)


def write_frame(
    pictures: Pictures, shot: Shot, relight: Relight, target: Path, fps: Fraction, look: Look, *, layered: bool = False
) -> None:
    """Link one image, or compose and convert it if format, light or look differ.

    Args:
        layered: write an EXR that holds the light of each group and the layers of the array, too.
    """
    source = pictures.whole_file(shot.c, shot.positions, relight)
    if source is not None and format_name(source) == format_name(target) and not look.changes and not layered:
        read_image(source)  # a damaged image must not slip into the sequence
        link_or_copy(Path(os.path.realpath(source)), target)
        return
    image, alpha = pictures.picture(shot.c, shot.positions, relight), pictures.alpha(shot.c)
    extension: Extension = format_name(target)  # type: ignore[assignment]  # checked by sequence_pattern
    attributes = _attributes(pictures.manifest, shot, fps)
    if layered:
        _write_layered(pictures, shot, relight, image, alpha, target, attributes)
    elif format_name(target) in FOR_SCREENS:
        text = shot_label(pictures.manifest, shot)
        if alpha is None or extension != "png" or look.label:  # a label is no part of the scene
            codes = screen_codes(image, look, text)
        else:
            shown, covered = unassociated(image, alpha)
            codes = np.dstack([screen_codes(shown, look, text), covered])
        write_codes(target, codes, ImageFormat(format=extension), attributes)
    else:
        more = pictures.differences(shot.c, shot.positions, relight) if extension == "exr" else None
        if extension == "exr":
            attributes |= {COLOUR_ID: SCENE_LIGHT}
        write_image(target, np.ascontiguousarray(image), ImageFormat(format=extension), attributes, more, alpha)


def _write_layered(
    pictures: Pictures,
    shot: Shot,
    relight: Relight,
    image: Image,
    alpha: Float32 | None,
    target: Path,
    attributes: dict[str, Attribute],
) -> None:
    """Write a picture, the light of each group that it is the sum of, and all layers of its camera into one EXR."""
    manifest, channels = pictures.manifest, _rgb("", image)
    if alpha is not None:
        channels["A"] = alpha
    for name, part in pictures.parts(shot.c, shot.positions, relight).items():
        channels |= _rgb(LIGHT + re.sub(r"\W", "_", name) + ".", part)
    for name, part in pictures.differences(shot.c, shot.positions, relight).items():
        channels |= _rgb(f"{name}.", part)
    attributes |= {COLOUR_ID: SCENE_LIGHT}
    if manifest.layers:
        path = layers_path(manifest, shot.c)
        channels |= read_layers(path)
        attributes |= read_texts(path, ATTRIBUTES)
    write_layers(target, channels, attributes)


def _rgb(prefix: str, image: Image) -> dict[str, Float32]:
    return {f"{prefix}{letter}": image[..., k] for k, letter in enumerate("RGB")}


def _attributes(manifest: Manifest, shot: Shot, fps: Fraction) -> dict[str, Attribute]:
    """Return the attributes of a frame's file."""
    camera = manifest.cameras[shot.c]
    first = shot.positions[0]
    whole = len(shot.positions) == 1 and not isinstance(first, Mixture) and first == int(first)
    attributes = frame_attributes(
        world_from_camera=camera.matrix,
        lens=camera.lens,
        resolution=manifest.resolution,
        fps=fps,
        c=shot.c,
        l=int(first) if whole and not isinstance(first, Mixture) else None,
        software=f"framearray {manifest.version}",
    )
    return attributes if whole else attributes | {"framearray:place": shot_label(manifest, shot)}
