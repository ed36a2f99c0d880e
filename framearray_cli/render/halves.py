"""How the hits of a job are split into two halves, which show the standard error of its images."""

from framearray_cli.engine.frames.passes import frames_per_turn
from framearray_cli.engine.frames.records import BY_SAMPLE
from framearray_cli.job.job import Job

# Least native hits per pixel that are sampled in two halves.
FEWEST_SPLIT = 4


def halves_of(job: Job, *, still: bool) -> int:
    """Return how the job's hits are split into two halves; see `FrameSetup.halves`.

    Frames see a place differently, so halves of frames differ by more than noise, which matters where noise is low.
    Halves of one or two samples are spread less evenly over a pixel than all these samples.
    """
    if not job.samples.halves:
        return 0
    by_sample = job.hits >= FEWEST_SPLIT or still or job.n_r == 0
    return BY_SAMPLE if by_sample else frames_per_turn(job.hits)
