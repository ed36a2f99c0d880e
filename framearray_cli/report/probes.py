"""The images of the array that a report compares with references."""

from collections.abc import Sequence
from dataclasses import dataclass

from framearray_cli.base.errors import JobError

# Places on the camera path and on the light path, 0 to 1.
CAMERA_PLACES = (1 / 3, 2 / 3)
LIGHT_PLACES = (1 / 6, 1 / 2, 5 / 6)


@dataclass(frozen=True, slots=True, kw_only=True)
class Probes:
    """Images to compare with references: those of some cameras under each of some light positions.

    Attributes:
        cameras: consecutive frames, (first,) or (first, next); the second shows flicker along the camera path.
        lights: light positions, in ascending order.
        light_pairs: indices in `lights` of neighbours l and l + 1, which show flicker along the light path.
    """

    cameras: tuple[tuple[int, ...], ...]
    lights: tuple[int, ...]

    @property
    def light_pairs(self) -> tuple[tuple[int, int], ...]:
        return tuple((i, i + 1) for i, l in enumerate(self.lights[:-1]) if self.lights[i + 1] == l + 1)


def choose_probes(
    n_c: int, n_l: int, cameras: Sequence[int] = (), lights: Sequence[int] = (), *, file: object = "probes"
) -> Probes:
    """Choose images of an array of n_c x n_l: cameras and lights, each with its next neighbour.

    Args:
        cameras, lights: the user's choice; if empty, a few spread over the paths.
        file: the name that an error reports.

    Raises:
        JobError: the array lacks a camera or light.
    """
    problems = [
        f"--{name}: expected 0 to {n - 1}, got {index}"
        for name, n, chosen in (("cameras", n_c, cameras), ("light", n_l, lights))
        for index in chosen
        if not 0 <= index < n
    ]
    if problems:
        raise JobError(str(file), problems)
    firsts = sorted(set(cameras)) or sorted({_index_at(share, n_c) for share in CAMERA_PLACES})
    found = sorted(set(lights) or {_index_at(share, n_l) for share in LIGHT_PLACES})
    return Probes(
        cameras=tuple((c, c + 1) if c + 1 < n_c else (c,) for c in firsts),
        lights=tuple(sorted({l for first in found for l in (first, first + 1) if l < n_l})),
    )


def _index_at(share: float, n: int) -> int:
    """Return the index at a share of a path of n, with a next neighbour if n allows."""
    return min(int(share * n), max(n - 2, 0))
