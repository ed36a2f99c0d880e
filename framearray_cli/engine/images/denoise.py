"""The door to Open Image Denoise: remove the noise from W of a frame, once for all light positions.

W exists once per camera position, not once per image, so denoising costs 1/N_l of what it costs to denoise images. The
product R W is formed afterwards, so that textures stay sharp. Normals and reflectivity guide the filter at the edges of
objects; it takes no depth.
"""

from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float32
from framearray_cli.base.extras import extra


def require_denoiser() -> Any:
    """Import the denoiser.

    Raises:
        MissingExtraError: pyoidn is not installed.
    """
    with extra("denoise.obscurance needs Open Image Denoise", "[denoise]"):
        import pyoidn
    return pyoidn


def denoise_obscurance(obscurance: Float32, reflectivity: Float32, normal: Float32) -> Float32:
    """Remove the noise from an image of W.

    Args:
        obscurance: (height, width, 3) W, 0 to 1.
        reflectivity: (height, width, 3), 0 to 1.
        normal: (height, width, 3) unit, 0 where there is no surface.
    Returns:
        (height, width, 3), 0 to 1.
    """
    smooth: Float32 = require_denoiser().denoise(obscurance, albedo=np.clip(reflectivity, 0.0, 1.0), normal=normal)
    np.clip(smooth, 0.0, 1.0, out=smooth)
    return smooth
