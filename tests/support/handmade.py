"""Small frame arrays written by hand; every image differs from its neighbours."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from framearray_cli.array.images import ImageFormat, write_image, write_layers
from framearray_cli.array.manifest import (
    Manifest,
    ManifestCamera,
    ManifestGroup,
    ManifestLight,
    image_path,
    layers_path,
    matrix_rows,
)
from framearray_cli.array.manifest_toml import write_manifest
from framearray_cli.base.arrays import Image

SIZE = (64, 48)
N_C, N_L = 7, 5
PLAIN = {
    "version": "0",
    "name": "room",
    "resolution": SIZE,
    "fps": 24.0,
}
FLOAT = ImageFormat(half="never")


def light(*ambient: float) -> ManifestLight:
    return ManifestLight(ambient=ambient, ambient_error=(0.0, 0.0, 0.0), sources=({"type": "point"},))


def group_of(name: str, axis: str, lights: Iterable[ManifestLight], stem: str = "") -> ManifestGroup:
    """A group; the names of its images begin with a stem and its own name."""
    images = f"{stem}{name}.c{{camera:04d}}.l{{light:03d}}.exr"
    return ManifestGroup(name=name, axis=axis, images=images, lights=tuple(lights))


def cameras(n: int) -> tuple[ManifestCamera, ...]:
    return (ManifestCamera(world_from_camera=matrix_rows(np.eye(4)), fov=60.0),) * n


def soft(c: float, l: float, top: float = 1.0) -> Image:
    """A soft picture, (h, w, 3): a hill that moves with c and l, over a slope; its summit is `top`."""
    width, height = SIZE
    x, y = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    hill = np.exp(-20 * ((x - 0.2 - 0.1 * c) ** 2 + (y - 0.2 - 0.12 * l) ** 2))
    slope = 0.05 + 0.2 * np.stack([x, y, 1 - x], axis=-1)
    return np.asarray(slope + (top - 0.25) * hill[..., None] * [1.0, 0.8, 0.6], np.float32)


def plain(folder: Path, *, n_c: int = N_C, n_l: int = N_L, layers: bool = True) -> Manifest:
    """EXR images with values up to 6, and layers."""
    manifest = Manifest(
        **PLAIN,
        fingerprint="sha256:1",
        images="room.c{camera:04d}.l{light:03d}.exr",
        layers="room.layers.c{camera:04d}.exr" if layers else "",
        cameras=cameras(n_c),
        lights=tuple(light(0.1, 0.1, 0.1) for _ in range(n_l)),
        directory=folder,
    )
    for c in range(n_c):
        for l in range(n_l):
            write_image(image_path(manifest, c, l), soft(c, l, top=6.0), FLOAT)
        if layers:
            write_layers(layers_path(manifest, c), layer_channels(c))
    write_manifest(folder, manifest)
    return manifest


def circled(folder: Path) -> Manifest:
    """The images of `plain`, under light from north, east, south, west and above."""
    ways = [(0, 0, -1), (1, 0, 0), (0, 0, 1), (-1, 0, 0), (0, 1, 0)]
    manifest = plain(folder, layers=False)
    tables = [{"type": "directional", "direction": [-x for x in way], "irradiance": [1.0] * 3} for way in ways]
    lights = tuple(replace(light, sources=(table,)) for light, table in zip(manifest.lights, tables, strict=True))
    manifest = replace(manifest, lights=lights)
    write_manifest(folder, manifest)
    return manifest


def write_sky(file: Path, top: float = 20.0) -> Path:
    """Write a map with a bright sun low in the north."""
    panorama = np.full((16, 32, 3), 0.05, np.float32)
    panorama[5, 16] = [top, 0.8 * top, 0.5 * top]
    write_image(file, panorama, FLOAT)
    return file


def layer_channels(c: int) -> dict[str, Image]:
    names = ("obscurance", "indirect", "reflectivity")
    channels = {f"{name}.{rgb}": soft(c, k, 0.9)[..., i] for k, name in enumerate(names) for i, rgb in enumerate("RGB")}
    normal = {f"normal.{axis}": 2 * soft(c, 1)[..., i] - 1 for i, axis in enumerate("XYZ")}
    return channels | normal | {"depth.Z": 8 * soft(c, 0)[..., 0], "samples": 30 * soft(c, 3)[..., 1]}


def grouped_manifest(folder: Path) -> Manifest:
    """Lamps with an axis of their own, the sun on the main one, ambient light and a background."""
    return Manifest(
        **PLAIN,
        fingerprint="sha256:2",
        cameras=cameras(4),
        groups=(
            group_of("lamps", "lamps", [light(0.5, 0.4, 0.3), light(0.1, 0.1, 0.1)], "room."),
            group_of("sun", "light", [light(0.1 * l, 0.2, 0.3) for l in range(3)], "room."),
        ),
        ambient_images="room.ambient.c{camera:04d}.exr",
        background_images="room.background.c{camera:04d}.exr",
        background_ambient=(0.01, 0.02, 0.03),
        directory=folder,
    )


def grouped(folder: Path) -> Manifest:
    """Images of `grouped_manifest`."""
    manifest = grouped_manifest(folder)
    for c in range(4):
        for group, top in zip(manifest.groups, (0.6, 2.5), strict=True):
            for l in range(len(group.lights)):
                write_image(image_path(manifest, c, l, group), soft(c, 2 * l, top), FLOAT)
        write_image(folder / manifest.ambient_images.format(camera=c), soft(c, 3, 0.8), FLOAT)
        write_image(folder / manifest.background_images.format(camera=c), 0.2 * soft(c, 4, 0.5), FLOAT)
    write_manifest(folder, manifest)
    return manifest
