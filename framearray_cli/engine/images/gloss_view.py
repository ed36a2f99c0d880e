"""How an eye sees glossy hits: what `add_gloss` is given, and what it needs of a hit and of meshes that shine."""

from typing import Any, NamedTuple, cast

import numpy as np

from framearray_cli.base.arrays import Float32, Int32, Real, Triple

from ..frames.setup import FrameSetup
from ..inputs.emitters import emitted_colour, kept_point
from ..inputs.gloss import STEPS
from ..inputs.lights import LightArrays
from ..kernels.kernel import optional_step
from ..kernels.simd import LANES, store

_LANE_BITS = (1 << np.arange(LANES)).astype(np.int32)


class GlossView(NamedTuple):
    """How an eye sees glossy hits.

    Attributes:
        eye: (1, 3) its position; (0,) where nothing is glossy: kernels are then compiled without gloss.
        lights: at all light positions.
        albedo: see `albedo_table`.
        lobes: whether rays have followed what hits reflect; not behind mirrors.
        glass: whether hits keep the irradiance of each source, which glass dims, and not only whether there is any.
        bits: (LANES,) the bit of each lane.
    """

    eye: Float32
    lights: LightArrays
    albedo: Float32
    lobes: bool
    glass: bool
    bits: Int32


NO_GLOSS = GlossView(
    np.empty(0, np.float32), cast(LightArrays, ()), np.empty((0, STEPS, STEPS), np.float32), False, False, _LANE_BITS
)


def gloss_view(setup: FrameSetup) -> GlossView:
    """What all eyes see of gloss; NO_GLOSS where nothing is glossy."""
    if not setup.shiny:
        return NO_GLOSS
    return GlossView(
        setup.cams.position[:1], setup.lights, setup.glossy.albedo, setup.lobes, setup.has_glass, _LANE_BITS
    )


class Coat(NamedTuple):
    """A glossy hit.

    Attributes:
        at: address of what is kept of it.
        alpha, v, m: see `evaluate_lobe`.
        p, g: point and geometric normal.
        key: random key, in lanes.
        even: the share of indirect light in the lobe that counts as even; rays have followed the rest.
        share: w t of each channel.
        base, f0, diffuse: colours.
    """

    at: int
    alpha: Real
    v: Triple
    m: Triple
    p: Triple
    g: Triple
    key: Any
    even: Real
    share: Triple
    base: Triple
    f0: Triple
    diffuse: Triple


@optional_step("emitters.span")
def find_mesh(emitters: Any, key: Any, s: int, p: Triple, g: Triple, m: Triple, room: Float32) -> int:
    """Write the vector to the point that a hit keeps of a mesh, the factor of its irradiance, and its texture."""
    kept, (x, y, z), factor = kept_point(emitters, key, s, p, g, m)
    store(room, 0, x)
    store(room, LANES, y)
    store(room, 2 * LANES, z)
    store(room, 3 * LANES, factor)
    colour = emitted_colour(emitters, kept)
    for channel in range(3):
        store(room, (4 + channel) * LANES, colour[channel])
    return 0
