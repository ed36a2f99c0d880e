"""What wide lobes of glossy surfaces reflect where there are no cells: the ambient light of their rays.

    L(v)[l] = t I_A[l] sum over rays of w R(Q) rho(d) / sum over rays of w        Q: where a ray of the lobe ends, at d

This is W for the lobe in place of the hemisphere; only where a ray meets nothing at all it has no R(Q), and brings the
background. Following the rays to hits with a light of their own would cost as much as native hits, for two rays of a
lobe that meet a spot of sun, or do not: noise that no filter could take for anything else.
"""

import numpy as np

from framearray_cli.base.arrays import Real, Rgb

from ..hits.hits import SURFACE, Hits
from ..kernels.kernel import kernel
from .cells.gather import COLOUR
from .falloff import rho
from .lobe_cells import LobeLight
from .obscurance_rays import ObscuranceSettings


@kernel
def read_ambient(
    hits: Hits, reflected: Hits, m: int, glow: Rgb, background: Rgb, settings: ObscuranceSettings, out: LobeLight
) -> None:
    """Add what rays 0 to m - 1 of lobes find at their ends to the sums of their hits: R(Q) rho(d) as their colour.

    Args:
        glow: (>= m, 3) radiance that the ends send out without being sources, or (0, 3).
        background: (3,) radiance outside the scene.
    """
    one, d_max = np.float32(1.0), np.float32(settings.d_max)
    for k in range(m):
        i, w = out.place[k], out.weight[k]
        if reflected.kind[k] != SURFACE:
            for channel in range(3):
                out.constant[i, channel] += w * out.passed[k, channel] * background[channel]
            continue
        q, p = reflected.position[k], hits.position[i]
        open_share: Real = one
        x, y, z = q[0] - p[0], q[1] - p[1], q[2] - p[2]
        distance = np.sqrt(x * x + y * y + z * z)
        if distance < d_max:
            open_share = rho(settings.falloff, np.float32(settings.tau), np.float32(distance / d_max))
        for channel in range(3):
            left = w * out.passed[k, channel]
            r = reflected.reflectivity[k, channel] + reflected.specular[k, channel]
            out.light[i, COLOUR + channel] += left * open_share * r
            if glow.shape[0]:
                out.constant[i, channel] += left * glow[k, channel]


@kernel
def complete_ambient(n: int, out: LobeLight) -> None:
    """Turn the sums of hits 0 to n - 1 into means."""
    for i in range(n):
        if out.share[i] > np.float32(0.0):
            inverse = np.float32(1.0) / out.share[i]
            for channel in range(3):
                out.constant[i, channel] *= inverse
                out.light[i, COLOUR + channel] *= inverse
