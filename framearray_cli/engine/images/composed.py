"""A composed frame: its images, layers and errors."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from framearray_cli.base.arrays import Float32, Images, Int32

from .marks import MarkLayers


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Layers:
    """What is the same under every light, (height, width, channels) or (height, width).

    Attributes:
        obscurance, indirect, reflectivity: W, R W and R, averaged over all hits.
        normal, depth: shading normal and distance along the optical axis, averaged over native hits; 0 if all escape.
        samples: number of hits of the pixel, native and outer.
        sun_hours: by day and in total, see `sun_layers`; empty unless the job counts them.
        marks: position, texture coordinates and mattes; None unless the job keeps them.
    """

    obscurance: Float32
    indirect: Float32
    reflectivity: Float32
    normal: Float32
    depth: Float32
    samples: Float32
    sun_hours: Mapping[str, Float32] = field(default_factory=dict)
    marks: MarkLayers | None = None


@dataclass(slots=True, kw_only=True, eq=False)
class Composed:
    """A composed frame.

    Attributes:
        c: the eye of the frame.
        images: (n_lights, height, width, 3) radiance.
        layers: None unless the job keeps them.
        hits: (n_pixels,) number of hits of each pixel, native and outer.
        beyond: number of values beyond the largest half; where images are halves, they were cut to it.
        bad: number of values that were not finite, or negative; each was replaced by 0.
        first_bad: light index and pixel of the first of them, or None.
        differences: (n_lights, height, width, 3) D of the halves of the hits, see `standard_error.py`; or None.
        alpha: (height, width) share of each pixel that the scene covers; None unless the job keeps it.
    """

    c: int
    images: Images
    layers: Layers | None
    hits: Int32
    beyond: int
    bad: int
    first_bad: tuple[int, int] | None
    differences: Float32 | None = None
    alpha: Float32 | None = None


def layers_of(
    maps: Float32,
    own: Float32,
    samples: Int32,
    shape: tuple[int, ...],
    sun_hours: Mapping[str, Float32],
    marks: MarkLayers | None,
) -> Layers:
    """The layers of a frame.

    Args:
        maps, samples: see `Pixels`.
        own: (n_pixels, 4) normal and depth, see `average_native`.
        shape: (height, width).
        sun_hours, marks: see `Layers`.
    """
    return Layers(
        obscurance=maps[:, :3].reshape(*shape, 3),
        indirect=maps[:, 3:6].reshape(*shape, 3),
        reflectivity=maps[:, 6:].reshape(*shape, 3),
        normal=own[:, :3].reshape(*shape, 3),
        depth=own[:, 3].reshape(shape),
        samples=samples.astype(np.float32).reshape(shape),
        sun_hours=sun_hours,
        marks=marks,
    )
