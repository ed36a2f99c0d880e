"""How far rendered light is from that of paths, over blocks of pixels, with the noise of the paths taken out."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from support import tiny
from support.lit_rooms import RESOLUTION, LitRoom
from support.pathtraced import path_traced

BLOCK = 4  # pixels per edge of a block
GROUPS = 16  # of independent pictures, whose spread gives the noise of their mean


@dataclass(frozen=True, slots=True, kw_only=True)
class LightError:
    """Errors of indirect light against paths; direct light is that of the same hits, and counts as right.

    Attributes:
        mean: of all light over the right one, minus 1; `mean_error`: its standard error, that of the paths.
        whole: root mean square error of means over blocks, over the root mean square of all light.
        indirect: the same over the mean indirect light.
    """

    mean: float
    mean_error: float
    whole: float
    indirect: float


def blocks_of(images: Any) -> Any:
    """(..., h, w, 3) -> (..., h / BLOCK, w / BLOCK, 3)."""
    *front, h, w, _ = images.shape
    return images.reshape(*front, h // BLOCK, BLOCK, w // BLOCK, BLOCK, 3).mean(axis=(-4, -2))


def rendered(room: LitRoom, **changes: Any) -> Any:
    """Images of the eyes of a room, (n_c, h, w, 3), under its only light position."""
    return tiny.render_frames(tiny.prepared(room.job(**changes), room.scene()), threads=2).images[:, 0]


def paths_of(room: LitRoom, samples: int) -> Any:
    """Groups of pictures of indirect light by paths, (GROUPS, n_c, h, w, 3)."""
    width, height = RESOLUTION
    inputs = tiny.prepared(room.job(), room.scene())
    found = []
    for c in range(inputs.n_cameras):
        groups = [
            path_traced(inputs, c, samples // GROUPS, first=g * (samples // GROUPS), direct=False).mean(axis=0)
            for g in range(GROUPS)
        ]
        found.append(np.array(groups)[:, :, :, 0].reshape(GROUPS, height, width, 3))
    return np.stack(found, axis=1)


def light_error(images: Any, direct: Any, paths: Any) -> LightError:
    """Compare images less their direct light, (n_c, h, w, 3), with groups of pictures of indirect light by paths."""
    means = paths.mean(axis=(1, 2, 3, 4))
    indirect, of_sources = float(means.mean()), float(direct.mean())
    blocks, groups = blocks_of(images - direct), blocks_of(paths)
    square = float(((blocks - groups[::2].mean(axis=0)) * (blocks - groups[1::2].mean(axis=0))).mean())
    rms = float(((blocks_of(direct) + groups.mean(axis=0)) ** 2).mean()) ** 0.5
    return LightError(
        mean=float((images - direct).mean() - indirect) / (indirect + of_sources),
        mean_error=float(means.std(ddof=1)) / GROUPS**0.5 / (indirect + of_sources),
        whole=max(square, 0.0) ** 0.5 / rms,
        indirect=max(square, 0.0) ** 0.5 / indirect,
    )
