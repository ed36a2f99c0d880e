"""Warnings of light from cells that is far from that of paths."""

from collections.abc import Iterator

from framearray_cli.base.units import digits
from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.engine.terms.ambient.intensity import Accuracy
from framearray_cli.job.job import Job

# Errors beyond which images are wrong, over the mean indirect light: of its mean, and of single points.
MOST_BIAS, MOST_ERROR = 0.05, 0.25
# Standard errors by which an error must lie beyond.
SURE = 2.0


def indirect_warnings(job: Job, setup: FrameSetup, accuracy: Accuracy | None) -> Iterator[str]:
    """Find cells that are too large, too small, or have too few samples."""
    if accuracy is None or setup.indirect.cells is None or not is_bad(accuracy):
        return
    remedy = "leave indirect.cell out, or raise indirect.samples"
    if job.indirect.cell is None:
        remedy = "raise indirect.samples, or set a smaller indirect.cell beside it"
    edge = digits(setup.indirect.cells.grid.edge, 2)
    yield (
        f"indirect.cell, indirect.samples: {accuracy.note}, with cells of {edge} scene units and "
        f"{job.indirect.samples:,} samples; {remedy}"
    )


def is_bad(accuracy: Accuracy) -> bool:
    """Whether errors are beyond what light from cells usually has, by more than their own noise."""
    return (
        abs(accuracy.bias) - SURE * accuracy.bias_error > MOST_BIAS
        or accuracy.error - SURE * accuracy.error_error > MOST_ERROR
    )
