"""Short camera paths through a frame of a job: as the job says, faster, and close to a surface."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bench.core.cases import Case
from bench.core.frames import frame
from framearray_cli.engine.inputs.cameras import Cameras

N_R = 3
MIDDLE = 2 * N_R  # the measured frame; all eyes of its window have whole windows
STEPS = np.arange(-2 * N_R, 2 * N_R + 1)
# The number of frames of the job per step of a fast camera.
SPEED = 8
# Distance of the close eye from the surface that it looks at, in scene units; it is a fifth nearer in each frame.
CLOSE, NEARER = 0.3, 0.8


def slow(case: Case, c: int) -> Cameras:
    """The eyes about frame c as they are."""
    return _some(case, c + STEPS)


def fast(case: Case, c: int) -> Cameras:
    """Every SPEED-th eye of the path; the same picture in the middle."""
    return _some(case, c + SPEED * STEPS)


def close(case: Case, c: int) -> Cameras:
    """An eye that approaches the surface in the middle of frame c, in the direction of frame c."""
    cams = _some(case, np.full(len(STEPS), c))
    single = seen_by(replace(case, setup=replace(case.setup, n_r=0)), cams)
    layers = frame(single, MIDDLE, seed=0, layers=True).layers
    depth = layers["depth"][cams.height // 2, cams.width // 2]
    met = cams.position[0] + depth * cams.forward[0]
    left = CLOSE * NEARER**STEPS
    return cams._replace(position=(met - left[:, None] * cams.forward).astype(np.float32))


CAMERAS: dict[str, Callable[[Case, int], Cameras]] = {"slow": slow, "fast": fast, "close": close}


def seen_by(case: Case, cams: Cameras) -> Case:
    """The same job seen by other eyes; each finds as many hits as a frame in the middle of its path."""
    middle = case.setup.per_pixel[case.setup.n_frames // 2]
    return replace(case, setup=replace(case.setup, cams=cams, per_pixel=np.full(len(cams.position), middle)))


def _some(case: Case, at: NDArray[np.int64]) -> Cameras:
    if at.min() < 0 or at.max() >= case.setup.n_frames:
        raise ValueError(f"frames {at.min()} to {at.max()} do not fit a path of {case.setup.n_frames}")
    cams, names = case.setup.cams, ("position", "right", "up", "forward")
    return cams._replace(**{name: np.ascontiguousarray(getattr(cams, name)[at]) for name in names})
