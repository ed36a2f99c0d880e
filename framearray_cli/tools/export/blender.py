"""The layout of NeRF's synthetic scenes: a folder of PNG per set, and `transforms_train.json`, `_val`, `_test`.

Each file has one `camera_angle_x`, and `file_path` without a suffix, to which readers add ".png".
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from framearray_cli.base.errors import OutputError
from framearray_cli.base.lens import PERSPECTIVE, Lens

from .frames import focal_lengths, frame_table, image_size, write_json
from .selection import Selection, frames_by_set
from .splits import SETS

TRAIN_FILE = "transforms_train.json"
POINTS_FILE = "points3d.ply"  # where Gaussian splatting looks for points of such a scene
DEFAULT_RULE = "80/10/10"


def check_lens(selection: Selection) -> None:
    """Check that all cameras are perspectives with the same field of view, and square pixels around their axis.

    Raises:
        OutputError: they are not, or differ.
    """
    manifest = selection.manifest
    for c in selection.cameras:
        if not manifest.cameras[c].lens.is_plain:
            found = _lens_text(manifest.cameras[c].lens)
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


def _lens_text(lens: Lens) -> str:
    if lens.type != PERSPECTIVE:
        return f'type "{lens.type}"'
    return f"shift {list(lens.shift)} and pixel_aspect {lens.pixel_aspect:g}"


def write_sets(folder: Path, selection: Selection, files: Mapping[str, str], *, exposure: float) -> None:
    """Write the three files; without a set for one of val and test, both list the pictures of the other.

    Args:
        folder: of the export.
        files: name of a frame -> its file, relative to the folder.
        exposure: of the pictures, in stops.

    Raises:
        OutputError: the pose of a camera is no rigid motion, or a file cannot be written.
    """
    manifest = selection.manifest
    first = selection.cameras[0]
    head: dict[str, Any] = focal_lengths(manifest, first) | image_size(manifest, first)
    head |= {"exposure": exposure} if exposure else {}
    frames = frames_by_set(selection)
    for name in SETS:
        tables = [
            {"file_path": f"./{files[frame.name].removesuffix('.png')}"} | frame_table(manifest, frame)
            for frame in frames[name]
        ]
        write_json(folder / f"transforms_{name}.json", head | {"frames": tables})
