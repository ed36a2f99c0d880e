"""`transforms.json` as nerfstudio reads it, and the layout of NeRF's synthetic scenes, named blender after its origin.

nerfstudio has one file, depth files and a point cloud. NeRF's scenes have a folder of PNG per set, and
`transforms_train.json`, `_val`, `_test`, each with one `camera_angle_x`, and `file_path` without its suffix ".png".
"""

from typing import Any

import numpy as np

from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import write_bytes
from framearray_cli.base.lens import PERSPECTIVE

from .format import (
    CAMERA_MODELS,
    Export,
    Format,
    PointCloud,
    Selection,
    centre,
    focal_lengths,
    frame_table,
    frames_by_set,
    image_size,
    write_array,
    write_json,
)
from .points import read_depth
from .splits import SETS

TRANSFORMS_FILE = "transforms.json"
POINTS_FILE = "points.ply"
SPLAT_POINTS = "points3d.ply"  # where Gaussian splatting finds points of a synthetic scene
# nerfstudio multiplies depths by its `depth_unit_scale_factor`, 0.001 by default.
DEPTH_UNITS = 1000.0


def write_transforms(export: Export) -> None:
    """Write `transforms.json`, and for an array with layers a depth file per camera and the point cloud.

    The parser needs lists of all three sets as soon as there is one. See `Format.write`.
    """
    selection, folder, cloud = export.selection, export.folder, export.cloud
    manifest, first = selection.manifest, selection.cameras[0]
    lenses = {c: manifest.cameras[c].lens for c in selection.cameras}
    same_lens = all(lens == lenses[first] for lens in lenses.values())
    head: dict[str, Any] = {"camera_model": CAMERA_MODELS[lenses[first].type]} | image_size(manifest, first)
    if same_lens:
        head |= focal_lengths(manifest, first)
    if lenses[first].type == PERSPECTIVE:
        head |= dict.fromkeys(("k1", "k2", "p1", "p2"), 0.0)
    head |= export.head
    depths = {}
    if cloud is not None:
        depths = {c: f"depths/{selection.camera_name(c)}.npy" for c in selection.cameras}
        for c, name in depths.items():  # .npy, as a 16-bit PNG ends at 65.535 in steps of 0.001; 0 without a surface
            write_array(folder / name, read_depth(manifest, c) * np.float32(DEPTH_UNITS))
        if len(cloud.position):
            head["ply_file_path"] = POINTS_FILE
            write_bytes(folder / POINTS_FILE, ply(cloud))
    if selection.splits is not None:
        by_set = frames_by_set(export.frames).items()
        head |= {f"{name}_filenames": [frame.file for frame in frames] for name, frames in by_set}
    frames = []
    for frame in export.frames:
        table: dict[str, Any] = {"file_path": frame.file}
        if frame.c in depths:
            table["depth_file_path"] = depths[frame.c]
        if not same_lens:
            table |= focal_lengths(manifest, frame.c)
            table |= centre(manifest, frame.c) if lenses[frame.c].shift != lenses[first].shift else {}
        frames.append(table | frame_table(manifest, frame))
    write_json(folder / TRANSFORMS_FILE, head | {"frames": frames})


def ply(cloud: PointCloud, *, normals: bool = False) -> bytes:
    """Return points with colours as a binary PLY, in doubles, as a scene may lie far from its origin.

    Args:
        cloud: the points.
        normals: add normals of length 0, which Gaussian splatting expects and does not use.
    """
    normal = ("nx", "ny", "nz") if normals else ()
    rows = np.zeros(len(cloud.position), [("xyz", "<f8", 3), ("normal", "<f8", len(normal)), ("rgb", "u1", 3)])
    rows["xyz"], rows["rgb"] = cloud.position, cloud.codes
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(rows)}"]
    head += [f"property double {name}" for name in ("x", "y", "z", *normal)]
    head += [f"property uchar {name}" for name in ("red", "green", "blue")]
    return "\n".join([*head, "end_header", ""]).encode() + rows.tobytes()


def _check_lens(selection: Selection) -> None:
    """Check that all cameras are perspectives with the same field of view, and square pixels around their axis."""
    manifest = selection.manifest
    for c in selection.cameras:
        lens = manifest.cameras[c].lens
        if not lens.is_plain:
            found = f"shift {list(lens.shift)} and pixel_aspect {lens.pixel_aspect:g}"
            found = found if lens.type == PERSPECTIVE else f'type "{lens.type}"'
            raise OutputError(
                f"{manifest.directory}: cameras[{c}]: expected a perspective without shift, of square pixels: the "
                f"format has only camera_angle_x; got {found}; nerfstudio holds it"
            )
    angles = {manifest.cameras[c].lens.fov: c for c in reversed(selection.cameras)}
    if len(angles) > 1:
        (one, c), (other, d) = sorted(angles.items(), key=lambda pair: pair[1])[:2]
        raise OutputError(
            f"{manifest.directory}: expected one field of view, as the format has one camera_angle_x for all pictures, "
            f"got {one:g} degrees at camera {c} and {other:g} at camera {d}; nerfstudio and colmap hold several"
        )


def write_sets(export: Export) -> None:
    """Write the three files, and the points; without pictures for one of val and test, both list the other's.

    See `Format.write`.
    """
    manifest, first = export.selection.manifest, export.selection.cameras[0]
    head: dict[str, Any] = focal_lengths(manifest, first) | image_size(manifest, first) | export.head
    for name, frames in frames_by_set(export.frames).items():
        tables = [
            {"file_path": f"./{frame.file.removesuffix('.png')}"} | frame_table(manifest, frame) for frame in frames
        ]
        write_json(export.folder / f"transforms_{name}.json", head | {"frames": tables})
    if export.cloud is not None and len(export.cloud.position):
        write_bytes(export.folder / SPLAT_POINTS, ply(export.cloud, normals=True))


NERFSTUDIO = Format(mark=TRANSFORMS_FILE, write=write_transforms, all_lights=False, points=True)
BLENDER = Format(
    mark=f"transforms_{SETS[0]}.json",
    write=write_sets,
    stem=lambda frame: f"{frame.part}/{frame.name}",
    all_lights=False,
    points=True,
    rule="80/10/10",
    images=("png",),
    check=_check_lens,
)
