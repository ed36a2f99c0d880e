"""Which images of the array a report looks at."""

from collections.abc import Sequence
from dataclasses import dataclass

from framearray_cli.base.errors import JobError

# Where on the camera path and on the light path, 0 to 1.
CAMERA_PLACES = (1 / 3, 2 / 3)
LIGHT_PLACES = (1 / 6, 1 / 2, 5 / 6)


@dataclass(frozen=True, slots=True, kw_only=True)
class Probes:
    """Images that are compared with references: every one of some cameras under every one of some lights.

    Attributes:
        cameras: runs of frames, (first,) or (first, next): the second shows what flickers from frame to frame.
        lights: light positions, in rising order.
        light_pairs: places in `lights` of neighbours l and l + 1, which show what flickers along the light path.
    """

    cameras: tuple[tuple[int, ...], ...]
    lights: tuple[int, ...]

    @property
    def light_pairs(self) -> tuple[tuple[int, int], ...]:
        return tuple((i, i + 1) for i, l in enumerate(self.lights[:-1]) if self.lights[i + 1] == l + 1)


def probes(
    n_c: int, n_l: int, cameras: Sequence[int] = (), lights: Sequence[int] = (), *, file: object = "probes"
) -> Probes:
    """Choose the images of an array of n_c x n_l; each camera and light comes with its next neighbour.

    Args:
        cameras, lights: the user's choice; none: a few, spread over the paths.
        file: what an error names.

    Raises:
        JobError: a camera or light that the array does not have.
    """
    problems = [
        f"--{name}: expected 0 to {n - 1}, got {wish}"
        for name, n, wishes in (("camera", n_c, cameras), ("light", n_l, lights))
        for wish in wishes
        if not 0 <= wish < n
    ]
    if problems:
        raise JobError(str(file), problems)
    firsts = sorted(set(cameras)) or sorted({_place(share, n_c) for share in CAMERA_PLACES})
    found = sorted(set(lights) or {_place(share, n_l) for share in LIGHT_PLACES})
    return Probes(
        cameras=tuple((c, c + 1) if c + 1 < n_c else (c,) for c in firsts),
        lights=tuple(sorted({l for first in found for l in (first, first + 1) if l < n_l})),
    )


def _place(share: float, n: int) -> int:
    """A place of a path, so that its next neighbour exists where it can."""
    return min(int(share * n), max(n - 2, 0))
