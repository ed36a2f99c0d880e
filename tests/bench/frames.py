"""One frame of a case for one seed, of its whole window: what is compared with references."""

from dataclasses import replace

import numpy as np

from framearray_cli.crew import Crew
from framearray_cli.frame import find_frame
from framearray_cli.window import Composed, Window

from .cases import Case


def frame(case: Case, c: int, seed: int, layers: bool = False) -> Composed:
    """Find the hits of all eyes of the window of frame c, and compose it; its images are not rounded to halves."""
    work = replace(case.work, seed=seed, layers=layers)
    crew = Crew(work, case.threads)
    window = Window(work, case.ambient, crew, first=c)
    out = np.empty((len(work.kept), work.cams.height, work.cams.width, 3), np.float32)
    try:
        for other in work.frames_around(c, work.n_r):
            window.add(find_frame(work, other, crew))
        return window.compose(c, out)
    finally:
        crew.close()
