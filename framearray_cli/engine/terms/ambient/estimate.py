"""Average ambient intensity I_A[l] = E[l] / pi, estimated before the first frame [FA eq. 2].

E[l] is the average irradiance, all bounces counted, over the surface sides from which light comes to the eye. This
module has what all methods share: the estimate, batches of walks and their errors. `method = "eye"` is in
`from_eyes.py`, `method = "fit"` in `fitted.py`.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol, Self, TypeVar

import numpy as np

from framearray_cli.base.arrays import Float32, Float64, Rgb
from framearray_cli.base.threads import TaskPool

from ...embree.packets import DIRECTION, ORIGIN, TFAR
from ...hits.glass import BEFORE, shares_of_ways
from ...hits.hits import ESCAPED, Hits, World, empty_hits
from ...hits.rays import room_for_hits, room_for_tests
from ...inputs.lights import LightArrays
from ...inputs.panes import Panes, Sight, has_panes
from ...kernels.kernel import kernel
from ..accuracy import Accuracy
from ..direct import direct
from .walks import DIFFUSE, Walkers, advance, choose_step, deposit, empty_walkers

BATCH = 4096
# Automatic number of walks: batches are added until the standard error is this small, within bounds.
TARGET_ERROR = 0.01
MIN_WALKS, MAX_WALKS = BATCH, 64 * BATCH
# No walk of a frame uses this camera index, so that ambient walks are independent of every frame's samples.
AMBIENT_STREAM = (1 << 20) - 1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ambient:
    """The ambient estimate of a job.

    Attributes:
        intensity: (n_lights, 3) I_A, radiance.
        standard_error: (n_lights,) of I_A, relative to it, of the mean of the channels; 0 where I_A is 0 or given.
        reflectivity: (3,) average reflectivity over the surfaces that E averages; where there are none, over those
            that the eyes see.
        paths: number of walks; 0 where images have no ambient light.
        rays: number of rays traced.
        notes: messages for the user, e.g. that the estimate missed its target error.
        accuracy: of light from cells, which takes its place; None: without cells, or not measured.
        shared_s: seconds of preparing indirect light that do not grow with the number of light positions.
    """

    intensity: Rgb
    standard_error: Float64
    reflectivity: Rgb
    paths: int
    rays: int
    notes: tuple[str, ...] = ()
    accuracy: Accuracy | None = None
    shared_s: float = 0.0

    def for_lights(self, block: range) -> "Ambient":
        """The estimate of a block of light positions."""
        span = slice(block.start, block.stop)
        return replace(self, intensity=self.intensity[span], standard_error=self.standard_error[span])


class Workspace:
    """Arrays for one batch of walks, reused from batch to batch."""

    def __init__(self, lights: LightArrays) -> None:
        self.hit_packets = room_for_hits(BATCH).packets
        self.test_rays = room_for_tests(BATCH, lights.n_lights)
        self.hits = [empty_hits(BATCH), empty_hits(BATCH)]
        self.walkers = [empty_walkers(BATCH), empty_walkers(BATCH)]
        self.leaves = np.zeros((BATCH, 3), np.float32)  # whole packets, because kernels read hits in packets
        self.irradiance = np.empty((BATCH, lights.channels, lights.n_lights), np.float32)
        self.sums = np.empty((BATCH, 3, lights.n_lights), np.float32)
        self.rays = 0

    def advance(self, n: int, world: World, *, dimmed: bool = False) -> int:
        """Move all walks on; `hits[0]` and `walkers[0]` are the current ones before and after.

        Args:
            dimmed: True if the glass on their way dims them.
        """
        n = advance(self.hits[0], self.walkers[0], n, world, self.hit_packets, self.hits[1], self.walkers[1])
        self.hits.reverse()
        self.walkers.reverse()
        self.rays += n
        if dimmed and has_panes(world.panes) and n:
            self._pass_glass(n, world.panes)
        return n

    def _pass_glass(self, n: int, panes: Panes) -> None:
        """Dim the n current walks by the glass that the rays to them went through."""
        rows = self.hit_packets[:, : TFAR + 1].swapaxes(1, 2).reshape(-1, TFAR + 1)[:n]
        start, way = rows[:, ORIGIN : ORIGIN + 3], rows[:, DIRECTION : DIRECTION + 3]
        share, rays = shares_of_ways(start, way, rows[:, TFAR] * BEFORE, panes)
        self.walkers[0].throughput[:n] *= share
        self.rays += rays

    def add_direct(self, n: int, lights: LightArrays, sight: Sight) -> None:
        """Add the direct irradiance at every current hit that its walk leaves diffusely to the walk's sums."""
        self.leaves[:n] = self.walkers[0].step[:n, None] == DIFFUSE
        hits = self.hits[0]._replace(reflectivity=self.leaves)
        self.rays += direct(hits, n, lights, sight, self.test_rays, self.irradiance, False)
        deposit(self.walkers[0], n, self.irradiance[:n], lights.colour, self.sums)


@kernel
def choose_steps(hits: Hits, walkers: Walkers, n: int, must_go_on: bool) -> None:
    """Choose the next step of walks 0 to n - 1; see `choose_step`."""
    for i in range(n):
        choose_step(hits, walkers, i, must_go_on)


@kernel
def add_background(hits: Hits, walkers: Walkers, n: int, background: Rgb, sums: Float32) -> None:
    """Add the background's irradiance, pi times its radiance, to the sums of walks that left the scene."""
    for i in range(n):
        if hits.kind[i] == ESCAPED:
            for channel in range(3):
                light = walkers.throughput[i, channel] * np.float32(np.pi) * background[channel]
                for l in range(sums.shape[2]):
                    sums[walkers.walk[i], channel, l] += light


class Sums(Protocol):
    """Sums over a batch of walks, which add up to those of several batches."""

    def plus(self, other: Self) -> Self:
        """Sums over the walks of both."""


S = TypeVar("S", bound=Sums)


def walk_until(
    batch: Callable[[Workspace, int, int], S],
    enough: Callable[[S], bool],
    paths: int | None,
    lights: LightArrays,
    threads: int,
) -> S:
    """Walk batches in order, one per thread at a time, until they are enough; later batches do not count.

    So the result is the same for any number of threads.

    Args:
        batch: follows n walks from number `first` on, given (work, first, n).
        enough: whether the sums so far suffice.
        paths: largest number of walks; None: `MAX_WALKS`.
    """
    limit, found = paths or MAX_WALKS, None
    workspaces = [Workspace(lights) for _ in range(threads)]
    with TaskPool(threads, thread_name_prefix="ambient") as pool:
        for group in range(0, limit, threads * BATCH):
            starts = range(group, min(group + threads * BATCH, limit), BATCH)
            sizes = [min(BATCH, limit - first) for first in starts]
            for walked in pool.map(batch, workspaces, starts, sizes):
                found = found.plus(walked) if found else walked
                if enough(found):
                    return found
    assert found
    return found


def relative_error(total: Float64, squares: Float64, count: int) -> Float64:
    """Standard error of the mean over the channels' mean, per light position; 0 where nothing arrives."""
    mean = total.mean(axis=0) / count
    variance = np.maximum(squares / count - mean**2, 0.0) / max(count - 1, 1)
    error: Float64 = np.divide(np.sqrt(variance), mean, out=np.zeros_like(mean), where=mean > 0)
    return error


def make_ambient(
    mean: Float64, error: Float64, reflectivity: Float64, spent: int, rays: int, automatic: bool
) -> Ambient:
    """Make an estimate of means, with a note if it missed its target error.

    Args:
        mean: (3, n_lights) irradiance.
        error: (n_lights,) relative standard error.
        reflectivity: (3,) average.
        automatic: whether the program chose the number of walks.
    """
    notes: tuple[str, ...] = ()
    if automatic and error.max() > TARGET_ERROR:
        notes = (
            f"ambient: standard error {error.max():.1%} at light {int(error.argmax())} after {spent:,} walks, "
            "as many as the program takes unasked; set ambient.paths for more",
        )
    return Ambient(
        intensity=(mean.T / math.pi).astype(np.float32),
        standard_error=error,
        reflectivity=reflectivity.astype(np.float32),
        paths=spent,
        rays=rays,
        notes=notes,
    )
