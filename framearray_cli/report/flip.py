"""The door to HDR-FLIP: how visible a difference is, at all exposures that may show the image [Andersson21].

The library is optional within the extra `report`, for it has no wheel for Python 3.14.
"""

from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float32, Image
from framearray_cli.base.extras import install_command, not_installed

# The libraries of the extra `report` that it cannot do without.
EXTRA = ("matplotlib", "jinja2")


def require_extra() -> None:
    """Check that the libraries that a report needs are installed, before any work is done.

    Raises:
        MissingExtraError: one is missing.
    """
    from importlib.util import find_spec

    missing = [name for name in EXTRA if find_spec(name) is None]
    if missing:
        raise not_installed(f"a report needs {', '.join(missing)}", "[report]")


def has_flip() -> bool:
    """Whether HDR-FLIP can be computed."""
    from importlib.util import find_spec

    return find_spec("flip_evaluator") is not None


def flip_note() -> str:
    """Return why a report lacks HDR-FLIP; "" if it does not."""
    if has_flip():
        return ""
    return f"HDR-FLIP is left out, as flip-evaluator is not installed: {install_command('flip-evaluator')}"


def flip_map(image: Image, reference: Image) -> Float32 | None:
    """Compute HDR-FLIP of every pixel, (h, w), 0 to 1, at 67 pixels per degree, as on a desktop screen.

    None if its library is not installed.

    Args:
        image, reference: (h, w, 3) linear radiance; below 0 counts as 0.
    """
    if not has_flip():
        return None
    import flip_evaluator

    evaluator: Any = flip_evaluator
    shown = (np.ascontiguousarray(np.maximum(picture, 0.0), np.float32) for picture in (reference, image))
    error, _, _ = evaluator.evaluate(*shown, "HDR", inputsRGB=False, applyMagma=False, computeMeanError=False)
    return np.asarray(error, np.float32)[..., 0]
