"""What wide lobes of native hits reflect, from cells, filtered as indirect light is; see `terms/lobe_cells.py`."""

from itertools import pairwise

import numpy as np

from framearray_cli.base.arrays import Float32, Int32, Rgb

from ..hits.emission import SOURCE
from ..hits.gloss import ALPHA
from ..hits.hits import ESCAPED, Hits, trace_hits
from ..terms.cells.smooth import smooth_light
from ..terms.lobe_cells import RAYS_OF_LOBE, complete_lobes, read_lobe, write_lobe
from .glass import dim_reflected
from .records import HALF, LIGHT_INDEPENDENT, REFLECTIVITY, WEIGHT, HitRecords
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
    lobes, cells, gather = scratch.lobes, setup.cells, scratch.gather
    assert lobes is not None and cells is not None and gather is not None
    reflected, packets, n = scratch.reflected[0], scratch.hit_rays.packets, ends[-1]
    for first, last in pairwise(ends):
        for ray in range(RAYS_OF_LOBE):
            m = write_lobe(hits, first, last, ray, alpha, metal, packets, reflected, lobes)
            if m == 0:
                continue
            trace_hits(setup.world, packets, m, coherent=True, near=0.0, mirrors=True, hits=reflected)
            find_glow(setup, packets, m, scratch.glow)
            dim_reflected(setup, scratch, m, lobes.passed)
            scratch.rays["mirror"] += m
            scratch.rays["mirror obscurance"] += read_lobe(
                hits, reflected, m, alpha, scratch.glow, cells, setup.tracer, gather, scratch.test_rays, lobes
            )
    complete_lobes(n, cells, lobes)
    if smooth and scratch.smooth is not None:
        cams = setup.cams
        only = hits._replace(kind=np.where(lobes.share[: len(hits.kind)] > 0, hits.kind, np.uint8(ESCAPED)))
        smooth_light(
            only, n, cams.width, cams.height, setup.smooth, lobes.closeness, scratch.smooth, lobes.light, lobes.constant
        )  # fmt: skip
    followed = np.flatnonzero(lobes.share[:n] > 0)
    records = setup.empty_records(len(followed), mirrored=True)
    tint = throughput[followed] * lobes.tint[followed]
    records.row[:] = 0.0
    records.row[:, WEIGHT] = 1.0
    records.row[:, REFLECTIVITY : REFLECTIVITY + 3] = tint
    records.row[:, LIGHT_INDEPENDENT : LIGHT_INDEPENDENT + 3] = tint * lobes.constant[followed]
    records.row[:, HALF] = hits.half[followed]
    records.irradiance[:] = 0.0
    records.indirect[:] = lobes.light[followed]
    records.gloss[:, ALPHA] = 0.0
    if setup.shines:
        records.emission[:, SOURCE] = -1.0
    pixels = hits.pixel[followed]
    spans = pairwise(np.searchsorted(followed, ends).tolist())
    return [(pixels[first:last], records.part(slice(first, last))) for first, last in spans]
