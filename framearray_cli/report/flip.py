"""The door to HDR-FLIP: how visible a difference is, at all exposures that may show the image [Andersson21]."""

from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float32, Image
from framearray_cli.base.extras import not_installed

# The libraries of the extra `report`.
EXTRA = ("matplotlib", "flip_evaluator", "jinja2")


def require_extra() -> None:
    """Check that the libraries that a report needs are installed, before any work is done.

    Raises:
        MissingExtraError: one is missing.
    """
    from importlib.util import find_spec

    missing = [name for name in EXTRA if find_spec(name) is None]
    if missing:
        raise not_installed(f"a report needs {', '.join(missing)}", "[report]")


def flip_map(image: Image, reference: Image) -> Float32:
    """Compute HDR-FLIP of every pixel, (h, w), 0 to 1, at 67 pixels per degree, as on a desktop screen.

    Args:
        image, reference: (h, w, 3) linear radiance; below 0 counts as 0.
    """
    import flip_evaluator

    evaluator: Any = flip_evaluator
    shown = (np.ascontiguousarray(np.maximum(picture, 0.0), np.float32) for picture in (reference, image))
    error, _, _ = evaluator.evaluate(*shown, "HDR", inputsRGB=False, applyMagma=False, computeMeanError=False)
    return np.asarray(error, np.float32)[..., 0]
