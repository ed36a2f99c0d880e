"""Strips of pictures of the real scenes, as docs/quality/robustness.md shows them.

    PYTHONPATH=tests python tests/real/make_strips.py FOLDER STRIPS

reads the arrays that the jobs of `support.real_jobs` left in FOLDER/out, and writes STRIPS/NAME.jpg for every scene.
"""

import sys
from pathlib import Path

import numpy as np
from PIL import Image
from support.real_jobs import AS_FILE

import framearray

# job, camera, light; the last one of a scene with fewer
CHOSEN = (("sun", 3, 2), (f"sun{AS_FILE}", 3, 2), ("lamp", 2, 0), (f"lamp{AS_FILE}", 2, 0))


def strip(arrays: Path, name: str) -> Image.Image:
    """Four images side by side."""
    shown = []
    for kind, c, l in CHOSEN:
        array = framearray.open(arrays / f"{name}-{kind}")
        n_c, n_l = array.shape[:2]
        shown.append(array.srgb(min(c, n_c - 1), min(l, n_l - 1)))
    return Image.fromarray(np.concatenate(shown, axis=1))


def main(arrays: Path, strips: Path) -> None:
    strips.mkdir(parents=True, exist_ok=True)
    for name in sorted(folder.name.removesuffix("-sun") for folder in arrays.glob("*-sun")):
        strip(arrays, name).save(strips / f"{name}.jpg", quality=80)


if __name__ == "__main__":
    main(Path(sys.argv[1]) / "out", Path(sys.argv[2]))
