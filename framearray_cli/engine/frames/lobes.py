"""What wide lobes of native hits reflect: read from cells and filtered as indirect light is, or the ambient light.

See `terms/lobe_cells.py` and `terms/lobe_ambient.py`.
"""

from itertools import pairwise

import numpy as np

from framearray_cli.base.arrays import Float32, Int32, Rgb

from ..hits.emission import SOURCE
from ..hits.gloss import ALPHA
from ..hits.hits import ESCAPED, Hits, trace_hits
from ..terms.cells.gather import COLOUR
from ..terms.cells.smooth import smooth_light
from ..terms.lobe_ambient import complete_ambient, read_ambient
from ..terms.lobe_cells import RAYS_OF_LOBE, LobeLight, complete_lobes, read_lobe, write_lobe
from .glass import dim_reflected
from .records import HALF, INDIRECT, LIGHT_INDEPENDENT, OBSCURANCE, REFLECTIVITY, WEIGHT, HitRecords
from .scratch import Scratch
from .setup import FrameSetup
from .shading import find_glow


def wide_lobes(
    setup: FrameSetup,
    hits: Hits,
    throughput: Rgb,
    ends: list[int],
    alpha: Float32,
    metal: Float32,
    scratch: Scratch,
    *,
    smooth: bool,
) -> list[tuple[Int32, HitRecords]]:
    """Find what wide lobes reflect of the hits up to the last of `ends`; return pixels and records for each pair.

    Args:
        throughput: (n, 3) what passes on the way to the hits.
        alpha, metal: (n,) gloss of the hits.
        smooth: whether hits in a row are neighbours in the image, and the light is filtered.
    """
    lobes = scratch.lobes
    assert lobes is not None
    reflected, packets, n = scratch.reflected[0], scratch.hit_rays.packets, ends[-1]
    for first, last in pairwise(ends):
        for ray in range(RAYS_OF_LOBE):
            m = write_lobe(hits, first, last, ray, alpha, metal, packets, reflected, lobes)
            if m == 0:
                continue
            trace_hits(setup.world, packets, m, coherent=False, near=0.0, mirrors=True, hits=reflected)
            find_glow(setup, packets, m, scratch.glow)
            dim_reflected(setup, scratch, m, lobes.passed)
            scratch.rays["mirror"] += m
            _read(setup, hits, reflected, m, alpha, scratch, lobes)
    _complete(setup, hits, n, scratch, lobes, smooth)
    followed = np.flatnonzero(lobes.share[:n] > 0)
    records = setup.empty_records(len(followed), mirrored=True)
    tint = throughput[followed] * lobes.tint[followed]
    records.row[:] = 0.0
    records.row[:, WEIGHT] = 1.0
    records.row[:, REFLECTIVITY : REFLECTIVITY + 3] = tint
    records.row[:, LIGHT_INDEPENDENT : LIGHT_INDEPENDENT + 3] = tint * lobes.constant[followed]
    records.row[:, HALF] = hits.half[followed]
    records.irradiance[:] = 0.0
    if setup.cells is None:
        records.row[:, OBSCURANCE : OBSCURANCE + 3] = lobes.light[followed, COLOUR : COLOUR + 3]
        records.row[:, INDIRECT : INDIRECT + 3] = tint * lobes.light[followed, COLOUR : COLOUR + 3]
    else:
        records.indirect[:] = lobes.light[followed]
    records.gloss[:, ALPHA] = 0.0
    if setup.shines:
        records.emission[:, SOURCE] = -1.0
    pixels = hits.pixel[followed]
    spans = pairwise(np.searchsorted(followed, ends).tolist())
    return [(pixels[first:last], records.part(slice(first, last))) for first, last in spans]


def _read(
    setup: FrameSetup, hits: Hits, reflected: Hits, m: int, alpha: Float32, scratch: Scratch, lobes: LobeLight
) -> None:
    """Add what m rays of lobes find to the sums of their hits."""
    if setup.cells is None:
        read_ambient(hits, reflected, m, scratch.glow, setup.background, setup.obscurance, lobes)
        return
    assert scratch.gather is not None
    scratch.rays["mirror obscurance"] += read_lobe(
        hits,
        reflected,
        m,
        alpha,
        scratch.glow,
        setup.cells,
        setup.world.tracer,
        scratch.gather,
        scratch.test_rays,
        lobes,
    )


def _complete(setup: FrameSetup, hits: Hits, n: int, scratch: Scratch, lobes: LobeLight, smooth: bool) -> None:
    """Turn sums into means, and filter them where they are the light of cells."""
    if setup.cells is None:
        complete_ambient(n, lobes)
        return
    complete_lobes(n, setup.cells, lobes)
    if smooth and scratch.smooth is not None:
        cams = setup.cams
        only = hits._replace(kind=np.where(lobes.share[: len(hits.kind)] > 0, hits.kind, np.uint8(ESCAPED)))
        smooth_light(
            only, n, cams.width, cams.height, setup.smooth, lobes.closeness, scratch.smooth, lobes.light, lobes.constant
        )  # fmt: skip
