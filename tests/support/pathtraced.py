"""Pictures by plain paths, all light: the reference for approximations of indirect light.

The eye rays, surfaces and shadow rays are the program's; the estimate is a path per sample that goes on by chance, with
direct light at every vertex.
"""

from typing import Any

import numpy as np

from framearray_cli.engine.hits.hits import World
from framearray_cli.engine.hits.native import PixelSamples, native_hits
from framearray_cli.engine.inputs.panes import Sight
from framearray_cli.engine.terms.ambient.from_eyes import EyeWalks
from framearray_cli.engine.terms.ambient.intensity import BATCH, Workspace, add_background, choose_steps
from framearray_cli.render.plan import eye_cameras
from framearray_cli.render.prepare import Prepared, open_embree

SEED = 1 << 31  # no job of a test has it


def path_traced(inputs: Prepared, c: int, samples: int, first: int = 0, *, direct: bool = True) -> Any:
    """Independent pictures of camera c with one path per pixel each, (samples, n_pixels, 3, n_lights).

    Args:
        first: number of the first picture; each has random numbers of its own.
        direct: with the direct light of what the eye sees.
    """
    cams, background = eye_cameras(inputs), np.array(inputs.job.scene.background, np.float32)
    n = cams.width * cams.height
    assert n <= BATCH
    pictures = np.zeros((samples, n, 3, inputs.n_lights))
    with open_embree(inputs) as embree:
        world = World(inputs.surfaces, Sight(embree.tracer))
        walks = EyeWalks(
            cams=cams, seed=0, paths=None, world=world, lights=inputs.light_arrays, background=background
        )  # fmt: skip
        work = Workspace(inputs.light_arrays)
        for s in range(first, first + samples):
            hits, walkers = work.hits[0], work.walkers[0]
            pixels = PixelSamples(SEED + s, np.arange(n, dtype=np.int32), 1, 0, False)
            native_hits(cams, c, pixels, 0, n, world, True, work.hit_packets, hits)
            pixel = hits.pixel[:n].copy()
            walkers.walk[:n], walkers.throughput[:n] = np.arange(n), 1.0
            work.sums[:] = 0.0
            choose_steps(hits, walkers, n, False)
            add_background(hits, walkers, n, background, work.sums)
            if not direct:  # `follow` adds it, too
                work.sums[:] = 0.0
                work.add_direct(n, inputs.light_arrays, world.sight)
                work.sums *= -1.0
            walks.follow(work, n)
            pictures[s - first, pixel] = work.sums[:n] / np.pi
    return pictures
