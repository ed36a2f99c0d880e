"""The layout of NeRF's synthetic scenes: a folder of PNG per set, and `transforms_train.json`, `_val`, `_test`.

Each file has one `camera_angle_x`, and `file_path` without a suffix, to which readers add ".png".
"""

from collections.abc import Mapping
from pathlib import Path

from framearray_cli.base.errors import OutputError

from .frames import frame_table, image_size, lens, write_json
from .selection import Selection, focal_length, frames_by_set
from .splits import SETS

TRAIN_FILE = "transforms_train.json"
POINTS_FILE = "points3d.ply"  # where Gaussian splatting looks for points of such a scene
DEFAULT_RULE = "80/10/10"


def check_lens(selection: Selection) -> None:
    """Check that all cameras have the same field of view.

    Raises:
        OutputError: they differ.
    """
    manifest = selection.manifest
    angles = {manifest.cameras[c].fov: c for c in reversed(selection.cameras)}
    if len(angles) > 1:
        (one, c), (other, d) = sorted(angles.items(), key=lambda pair: pair[1])[:2]
        raise OutputError(
            f"{manifest.directory}: expected one field of view, as the format has one camera_angle_x for all pictures, "
            f"got {one:g} degrees at camera {c} and {other:g} at camera {d}; nerfstudio and colmap hold several"
        )


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
    head = lens(manifest, focal_length(manifest, selection.cameras[0])) | image_size(manifest)
    head |= {"exposure": exposure} if exposure else {}
    frames = frames_by_set(selection)
    for name in SETS:
        tables = [
            {"file_path": f"./{files[frame.name].removesuffix('.png')}"} | frame_table(manifest, frame)
            for frame in frames[name]
        ]
        write_json(folder / f"transforms_{name}.json", head | {"frames": tables})
