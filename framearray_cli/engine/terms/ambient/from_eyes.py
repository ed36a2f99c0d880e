"""I_A by walks from the eyes [FA eq. 2].

Walks start at eyes of the whole camera path. E[l] is the mean irradiance at the vertex after the eye hit, where
obscurance rays end. The same walks serve every light position l, so I_A does not flicker.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Float32, Float64, Points, Rgb

from ...embree.packets import set_ray
from ...hits.aiming import aim_ray
from ...hits.hits import SURFACE, Hits, World, trace_hits
from ...inputs.cameras import Cameras, eye_ray
from ...inputs.lights import LightArrays
from ...inputs.random import CHOICE, PIXEL, PIXEL_SAMPLE, r2, random_word, stream
from ...kernels.kernel import has_rows, kernel
from .intensity import (
    AMBIENT_STREAM,
    DIFFUSE,
    MAX_BOUNCES,
    MIN_WALKS,
    MIRROR,
    Ambient,
    Sums,
    Walkers,
    Workspace,
    add_background,
    choose_steps,
    make_ambient,
    walk_until,
)


def start_at_eyes(cams: Cameras, seed: int, first: int, n: int, world: World, work: Workspace) -> tuple[Hits, Walkers]:
    """Trace eye rays first to first + n - 1, spread over all images of the camera path by the golden ratio sequence.

    Returns:
        their hits and walks, of `work`.
    """
    hits, walkers = work.hits[0], work.walkers[0]
    _write_first_rays(cams, seed, first, n, work.hit_packets, hits, walkers)
    trace_hits(world, work.hit_packets, n, coherent=False, near=cams.near, mirrors=True, hits=hits)
    work.rays += n
    return hits, walkers


@kernel
def _write_first_rays(
    cams: Cameras, seed: int, first: int, n: int, packets: Float32, hits: Hits, walkers: Walkers
) -> None:
    """Write the eye rays of `start_at_eyes`, and start their walks."""
    # shifts of the sequences, the same for all walks
    key = stream(seed, AMBIENT_STREAM, 0, PIXEL_SAMPLE)
    start = random_word(key, PIXEL)
    turn, _ = r2(random_word(key, CHOICE), 0)
    n_c = cams.position.shape[0]
    for i in range(n):
        # place (a, b) in the image, and eye c by the golden section, a third sequence independent of the other two
        a, b = r2(start, first + i)
        e = (turn + (first + i) * 0.6180339887498949) % 1.0
        c = min(int(e * n_c), n_c - 1)
        # the eye ray
        dx, dy, dz = eye_ray(cams, c, a * cams.width, b * cams.height)
        o = cams.position
        set_ray(packets, i, o[c, 0], o[c, 1], o[c, 2], dx, dy, dz, np.float32(np.inf))
        if has_rows(cams.lens):
            aim_ray(cams, c, a * cams.width, b * cams.height, i, packets)
        # its random stream and number; throughput 1
        hits.key[i] = stream(seed, AMBIENT_STREAM, (first + i) & ((1 << 28) - 1), 0)
        walkers.walk[i] = i
        for channel in range(3):
            walkers.throughput[i, channel] = 1.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DiffuseSteps:
    """The diffuse step of each walk, from the point that an eye sees to the first vertex; rows are walks.

    Attributes:
        reflectivity: (n, 3) R of the point where the step starts.
        position: (n, 3) that point.
        distance: (n,) distance to the first vertex; inf if there is none, NaN if the eye sees no diffuse surface.
    """

    reflectivity: Rgb
    position: Points
    distance: Float32

    @classmethod
    def of(cls, n: int) -> "DiffuseSteps":
        """Steps of n walks, none of them recorded yet."""
        zeros = np.zeros((2, n, 3), np.float32)
        return cls(reflectivity=zeros[0], position=zeros[1], distance=np.full(n, np.nan, np.float32))

    def record_start(self, hits: Hits, walkers: Walkers, n: int) -> None:
        """Record where diffuse steps of walks 0 to n - 1 start."""
        leaves = walkers.step[:n] == DIFFUSE
        walk = walkers.walk[:n][leaves]
        self.reflectivity[walk], self.position[walk] = hits.reflectivity[:n][leaves], hits.position[:n][leaves]

    def record_end(self, hits: Hits, walkers: Walkers, n: int) -> None:
        """Record how far diffuse steps of walks 0 to n - 1 went."""
        came = walkers.step[:n] == DIFFUSE
        walk, surface = walkers.walk[:n][came], hits.kind[:n][came] == SURFACE
        away = np.linalg.norm(hits.position[:n][came] - self.position[walk], axis=-1)
        self.distance[walk] = np.where(surface, away, np.inf)


def walk_to_first_vertices(work: Workspace, n: int, world: World, steps: DiffuseSteps | None = None) -> int:
    """Move walks from eye hits through mirrors to the diffuse hit that the eye sees, and to the vertex after it.

    Walks that arrive early are set aside until the others have passed their mirrors.

    Args:
        steps: records the last, diffuse step.

    Returns:
        number of walks that arrived.
    """
    done_hits, done_walkers, found = [], [], 0
    for _ in range(MAX_BOUNCES):
        hits, walkers = work.hits[0], work.walkers[0]
        choose_steps(hits, walkers, n, True)
        if steps:
            steps.record_start(hits, walkers, n)
        n = work.advance(n, world)
        hits, walkers = work.hits[0], work.walkers[0]
        if steps:
            steps.record_end(hits, walkers, n)
        arrived = (walkers.step[:n] == DIFFUSE) & (hits.kind[:n] == SURFACE)
        done_hits.append(Hits(*(a[:n][arrived] for a in hits)))
        done_walkers.append(Walkers(*(a[:n][arrived] for a in walkers)))
        found += int(arrived.sum())
        rest = (walkers.step[:n] == MIRROR) & (hits.kind[:n] == SURFACE)
        n = int(rest.sum())
        arrays: tuple[NDArray[Any], ...] = (*hits, *walkers)
        for array in arrays:
            array[:n] = array[: len(rest)][rest]
        if n == 0:
            break
    targets: tuple[NDArray[Any], ...] = (*work.hits[0], *work.walkers[0])
    batches: list[tuple[NDArray[Any], ...]] = [(*h, *w) for h, w in zip(done_hits, done_walkers, strict=True)]
    for k, target in enumerate(targets):
        target[:found] = np.concatenate([batch[k] for batch in batches])
    return found


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EyeWalks:
    """Start, scene and lights of walks from the eyes; arguments of `ambient_by_eye`.

    Attributes:
        paths: number of walks; None: enough for a standard error of 1 %, at most `MAX_WALKS`.
        background: (3,) radiance outside the scene; it lights the surfaces too.
    """

    cams: Cameras
    seed: int
    paths: int | None
    world: World
    lights: LightArrays
    background: Rgb

    def batch(self, work: Workspace, first: int, n: int) -> Sums:
        """Follow walks first to first + n - 1 to their ends."""
        rays = work.rays
        hits, walkers = start_at_eyes(self.cams, self.seed, first, n, self.world, work)
        seen, seen_reflectivity = int((hits.kind[:n] == SURFACE).sum()), total_reflectivity(hits, n)
        left = walk_to_first_vertices(work, n, self.world)
        work.sums[:] = 0.0
        hits, walkers = work.hits[0], work.walkers[0]
        reflectivity = total_reflectivity(hits, left)
        walkers.throughput[:left] = 1.0
        walkers.step[:left] = DIFFUSE
        walks = walkers.walk[:left].copy()
        self.follow(work, left)
        gathered = work.sums[walks].astype(np.float64)  # (n_walks, 3, n_lights)
        return Sums(
            spent=n,
            rays=work.rays - rays,
            seen=seen,
            seen_reflectivity=seen_reflectivity,
            count=len(walks),
            reflectivity=reflectivity,
            total=gathered.sum(axis=0),
            squares=(gathered.mean(axis=1) ** 2).sum(axis=0),
        )

    def follow(self, work: Workspace, n: int) -> None:
        """Follow the n current walks to their ends, and add the light at every vertex to `work.sums`."""
        for _ in range(MAX_BOUNCES):
            work.add_direct(n, self.lights, self.world.sight)
            n = work.advance(n, self.world, dimmed=True)
            if self.background.any():
                add_background(work.hits[0], work.walkers[0], n, self.background, work.sums)
            choose_steps(work.hits[0], work.walkers[0], n, False)
            if n == 0:
                break


def ambient_by_eye(walks: EyeWalks, threads: int = 1) -> Ambient:
    """Estimate I_A[l] and the average reflectivity by walks from the eyes; the same for any number of threads."""
    found = walk_until(walks.batch, walks.paths, walks.lights, threads)
    if found.count == 0:
        reflectivity = found.seen_reflectivity / max(found.seen, 1)
        dark = make_ambient(found.total, found.squares, reflectivity, found.spent, found.rays, False)
        note = "ambient: no walk from the eyes met a second surface, so the ambient intensity is 0"
        return replace(dark, notes=(note,))
    mean = found.total / found.count
    return make_ambient(mean, found.error, found.average, found.spent, found.rays, walks.paths is None)


def fixed_ambient(walks: EyeWalks, intensity: Rgb, threads: int = 1) -> Ambient:
    """Take I_A from the job, (3,), and estimate only the average reflectivity, by a few walks."""
    walked = ambient_by_eye(replace(walks, paths=walks.paths or MIN_WALKS), threads)
    n_lights = walks.lights.n_lights
    return replace(walked, intensity=np.tile(intensity, (n_lights, 1)), standard_error=np.zeros(n_lights), notes=())


def total_reflectivity(hits: Hits, n: int) -> Float64:
    """Sum of diffuse and mirror reflectivity over hits 0 to n - 1, (3,); escaped rays have none."""
    return (hits.reflectivity[:n] + hits.specular[:n]).sum(axis=0, dtype=np.float64)
