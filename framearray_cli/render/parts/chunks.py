"""Split the camera path into chunks of consecutive frames, and compute the cost of their halos.

Each chunk is rendered independently. The hits of the N_r frames on either side of it, its halo, reach into it too, so
the chunk traces them, and so does the neighbour chunk that holds these frames.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from framearray_cli.base.errors import SceneError
from framearray_cli.job.job import Job

from ..prepare import open_embree, prepare

# Default frames of a chunk, per frame of N_r: the halo of 2 N_r frames is a quarter of it.
FRAMES_PER_N_R = 8
# Least default: without reuse there is no halo, but each chunk reads the scene and estimates the ambient light again.
FEWEST = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class Chunks:
    """A camera path in chunks.

    Attributes:
        each: the cameras of every chunk, in rising order.
        more: additional hits of the halos, relative to a render in one run; 0 for one chunk.
    """

    each: tuple[tuple[int, ...], ...]
    more: float


def split_cameras(cameras: Sequence[int], size: int) -> list[tuple[int, ...]]:
    """Split cameras, in rising order, into the fewest chunks of at most `size`, of almost equal length."""
    count = -(-len(cameras) // size)
    return [tuple(chunk.tolist()) for chunk in np.array_split(np.asarray(cameras, int), count)] if count else []


def default_size(n: int, n_r: int, workers: int = 1) -> int:
    """Return the default frames of a chunk: at most `FRAMES_PER_N_R` N_r, and a whole number of chunks per worker.

    Args:
        n: number of frames to render.
    """
    most = max(FRAMES_PER_N_R * n_r, FEWEST)
    return max(-(-n // (workers * -(-n // (workers * most)))), 1) if n else 1


def plan_chunks(cameras: Sequence[int], size: int, n_r: int, *, still: bool = False) -> Chunks:
    """Split cameras into chunks and compute the cost.

    Args:
        still: whether the camera never moves, so that every chunk traces the same single frame.
    """
    each = split_cameras(cameras, size)
    if still or not each:
        return Chunks(each=tuple(each), more=float(max(len(each) - 1, 0)))

    def found(chunk: Sequence[int]) -> float:
        """Count eyes whose hits a chunk shows; before and after the path they repeat its frames."""
        return float(len({eye for j in chunk for eye in range(j - n_r, j + n_r + 1)}))

    return Chunks(each=tuple(each), more=sum(map(found, each)) / found(cameras) - 1.0)


def resolve_n_r(job: Job) -> int:
    """Return N_r of a job; where it says "auto", the N_r that a render will choose.

    Raises:
        JobError, SceneError: the job cannot be rendered, or has no scene file.
    """
    if not job.scene.file.is_file():
        raise SceneError(f"{job.scene.file}: no such file")
    if job.reuse.n_r != "auto":
        return job.n_r
    from ..automatic import resolve_auto

    prepared = prepare(job)
    with open_embree(prepared) as embree:
        return resolve_auto(prepared, embree)[0].job.n_r
