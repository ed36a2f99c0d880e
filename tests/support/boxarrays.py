"""Frame arrays in closed form, without the renderer: images of the inside of a box.

The box reaches from LOW to HIGH. Each point of its sides has one colour; the eye, the depth along its axis and the
colour of each pixel follow from the crossing of one ray with six planes, in the middle of the pixel.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from framearray_cli.array.images import Extension, ImageFormat, format_name, read_image, write_image, write_layers
from framearray_cli.array.manifest import (
    Manifest,
    ManifestCamera,
    ManifestLight,
    image_path,
    layers_path,
    matrix_rows,
)
from framearray_cli.array.manifest_toml import write_manifest
from support import oracle_lens
from support.handmade import group_of

LOW, HIGH = np.array([-2.0, 0.0, -3.0]), np.array([2.0, 2.5, 3.0])
RESOLUTION = (60, 40)


def look_at(eye: Sequence[float], target: Sequence[float], roll: float = 0.0) -> np.ndarray:
    """world_from_camera: along -z, y up; rolled about the view, radians."""
    back = np.array(eye, float) - target
    back /= np.linalg.norm(back)
    right = np.cross([0.0, 1.0, 0.0], back)
    right /= np.linalg.norm(right)
    up = np.cross(back, right)
    c, s = np.cos(roll), np.sin(roll)
    matrix = np.eye(4)
    matrix[:3] = np.stack([c * right + s * up, c * up - s * right, back, eye], axis=1)
    return matrix


EYES = (
    look_at([0.3, 1.2, 2.1], [-0.4, 0.9, -1.0]),
    look_at([0.9, 1.5, 1.9], [-0.2, 1.0, -2.0], roll=0.3),
    look_at([-0.8, 0.7, 2.4], [1.5, 1.4, -1.0], roll=-0.2),
    look_at([0.2, 1.9, 2.6], [0.1, 0.2, -2.0]),
)


def light(l: int, n: int = 1, kind: str = "point") -> ManifestLight:
    point = {"type": "point", "position": (0.1 * l, 2.0, -0.5), "intensity": (8.0 + l, 7.0, 6.0)}
    sun = {"type": "directional", "direction": (0.0, -1.0, 0.1 * l), "irradiance": (3.0, 2.0, 1.0)}
    sources = tuple(dict(point if kind == "point" else sun) for _ in range(n))
    return ManifestLight(ambient=(0.5, 0.4, 0.3 + 0.1 * l), ambient_error=(0.0, 0.0, 0.0), sources=sources)


def plain_manifest(
    folder: Path = Path(),
    *,
    extension: str = "png",
    fov: Sequence[float] = (60.0,) * 4,
    lights: Sequence[ManifestLight] | None = None,
    layers: bool = True,
    at: Sequence[float] = (0.0, 0.0, 0.0),
) -> Manifest:
    """Four eyes, three lights; `at` moves everything."""
    moved = [eye + np.pad(np.array(at, float)[:, None], ((0, 1), (3, 0))) for eye in EYES]
    return Manifest(
        version="0",
        name="box",
        fingerprint="sha256:0",
        images=f"box.c{{camera:04d}}.l{{light:03d}}.{extension}",
        layers="box.layers.c{camera:04d}.exr" if layers else "",
        resolution=RESOLUTION,
        fps=24.0,
        cameras=tuple(
            ManifestCamera(world_from_camera=matrix_rows(eye), fov=angle) for eye, angle in zip(moved, fov, strict=True)
        ),
        lights=tuple(lights if lights is not None else (light(l) for l in range(3))),
        directory=folder,
    )


def grouped_manifest(folder: Path = Path()) -> Manifest:
    """The same eyes; lamps and sun apart, each with its own axis."""
    plain = plain_manifest(folder)
    groups = (
        group_of("lamps", "lamps", map(light, range(2)), "box."),
        group_of("sun", "light", [light(l, kind="directional") for l in range(3)], "box."),
    )
    return replace(plain, images="", lights=(), groups=groups, ambient_images="box.ambient.c{camera:04d}.exr")


def colour_at(points: np.ndarray) -> np.ndarray:
    """Linear colour of points on the sides of the box, (n, 3), smooth along each side."""
    share = (points - LOW) / (HIGH - LOW)
    return 0.1 + 0.8 * np.clip(share, 0, 1)


def see(manifest: Manifest, c: int, at: Sequence[float] = (0.0, 0.0, 0.0)) -> tuple[np.ndarray, np.ndarray]:
    """Return what eye c sees through pixel centres: depth along its axis (h, w), and colour (h, w, 3)."""
    width, height = manifest.resolution
    matrix, xy = manifest.cameras[c].matrix, np.stack(np.meshgrid(np.arange(width), np.arange(height)), -1) + 0.5
    axes = matrix[:3, 3] - at, matrix[:3, 0], matrix[:3, 1], -matrix[:3, 2]
    found = oracle_lens.rays(manifest.cameras[c].lens, manifest.resolution, axes, xy.reshape(-1, 2))
    eye, rays = (array.reshape(height, width, 3) for array in found)
    with np.errstate(divide="ignore"):
        depth = np.where(rays > 0, (HIGH - eye) / rays, (LOW - eye) / rays).min(axis=-1)
    return depth, colour_at(eye + depth[..., None] * rays)


def write_array(manifest: Manifest, at: Sequence[float] = (0.0, 0.0, 0.0)) -> Manifest:
    """Write an array without groups; image [c, l] holds the colours, a little darker for each l."""
    suffix: Extension = manifest.images.rpartition(".")[2]  # type: ignore[assignment]
    for c in range(manifest.n_cameras):
        depth, colour = see(manifest, c, at)
        for l in range(manifest.n_lights):
            image = (colour * 0.8**l).astype(np.float32)
            write_image(image_path(manifest, c, l), image, ImageFormat(format=suffix))
        if manifest.layers:
            write_layers(layers_path(manifest, c), {"depth.Z": depth.astype(np.float32)})
    write_manifest(manifest.directory, manifest)
    return manifest


def add_alpha(manifest: Manifest) -> tuple[Manifest, np.ndarray]:
    """Write the images of an array without groups anew, with an alpha that grows from the left to the right, (h, w)."""
    width, height = manifest.resolution
    alpha = np.broadcast_to(np.linspace(0, 1, width, dtype=np.float32), (height, width)).copy()
    for c in range(manifest.n_cameras):
        for l in range(manifest.n_lights):
            file = image_path(manifest, c, l)
            form = ImageFormat(format=format_name(file))  # type: ignore[arg-type]  # written as such before
            write_image(file, read_image(file) * alpha[..., None], form, alpha=alpha)
    manifest = replace(manifest, job={"output": {"alpha": True}})
    write_manifest(manifest.directory, manifest)
    return manifest, alpha


def write_groups(manifest: Manifest) -> Manifest:
    """Write an array with groups: R W holds the colours, direct light of a group is a share of them."""
    for c in range(manifest.n_cameras):
        depth, colour = see(manifest, c)
        files = {manifest.directory / manifest.ambient_images.format(camera=c): colour}
        for k, group in enumerate(manifest.groups):
            for l in range(len(group.lights)):
                files[image_path(manifest, c, l, group)] = colour * (0.1 + 0.2 * k + 0.05 * l)
        for file, image in files.items():
            write_image(file, image.astype(np.float32), ImageFormat(half="never"))
        write_layers(layers_path(manifest, c), {"depth.Z": depth.astype(np.float32)})
    write_manifest(manifest.directory, manifest)
    return manifest
