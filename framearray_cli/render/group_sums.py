"""Pictures that groups of sources add up to at full strength, in an array that stores the light of each."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from framearray_cli.array.images import ImageFormat, counted_part, pixel_shares
from framearray_cli.base.arrays import Float32, Images
from framearray_cli.scene.paths.paths import Lights, Plane


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GroupSum:
    """A picture: the sum of some image planes, and of one that I_A multiplies.

    Attributes:
        planes: the direct light of each group, and the background if there is one.
        indirect: the plane that holds R W.
        ambient: (3,) I_A of all groups together.
    """

    planes: tuple[int, ...]
    indirect: int
    ambient: Float32


def group_sums(lights: Lights, intensity: Float32) -> tuple[GroupSum, ...]:
    """Return the pictures along all light axes at once, one for each position of the longest; empty without groups.

    Args:
        intensity: (n_planes, 3) I_A of each plane.
    """
    if not lights.groups:
        return ()
    indirect = lights.planes.index(Plane.INDIRECT)
    always = tuple(p for p, plane in enumerate(lights.planes) if plane is Plane.BACKGROUND)
    sums = []
    for share in np.linspace(0, 1, max(len(group.positions) for group in lights.groups)):
        shining = [group.positions[round((len(group.positions) - 1) * float(share))] for group in lights.groups]
        dark = intensity[indirect]  # no source shines at that plane
        ambient = dark + sum((intensity[p] - dark for p in shining), np.zeros(3, np.float32))
        sums.append(GroupSum(planes=(*shining, *always), indirect=indirect, ambient=np.asarray(ambient, np.float32)))
    return tuple(sums)


def sum_shares(
    images: Images, sums: Sequence[GroupSum], image_format: ImageFormat, alpha: Float32 | None = None
) -> list[tuple[float, float]]:
    """Return the shares of clipped and of black pixels of some pictures; see `pixel_shares`.

    Args:
        images: (n_planes, h, w, 3).
        alpha: (h, w), see `pixel_shares`.
    """
    if not sums:
        return []
    parts, covered = counted_part(images), None if alpha is None else counted_part(alpha[..., None])[..., 0]
    found = []
    for one in sums:
        total = parts[one.indirect].astype(np.float32) * one.ambient
        for p in one.planes:
            total += parts[p]
        found.append(pixel_shares(total, image_format, covered))
    return found
