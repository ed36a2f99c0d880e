"""Ambient light in wide lobes, against plain sums."""

from typing import Any

import numpy as np

from framearray_cli.engine.hits.hits import ESCAPED, SURFACE, Hits, empty_hits
from framearray_cli.engine.terms.cells.gather import COLOUR
from framearray_cli.engine.terms.lobes import complete_ambient, read_ambient, room_for_lobes
from framearray_cli.engine.terms.obscurance import FALLOFFS, ObscuranceSettings

HITS, RAYS, RANGE = 5, 12, 1.5
BACKGROUND = np.array([0.7, 0.8, 1.0], np.float32)
SETTINGS = ObscuranceSettings(
    d_max=RANGE, falloff=FALLOFFS["sqrt"], tau=1.0, n_rays=4, step_x=1, step_y=1, coherent=True, sky=False,
    average=np.full(3, 0.5, np.float32), background=BACKGROUND,
)  # fmt: skip


def rays() -> tuple[Hits, Hits, Any, Any]:
    """Hits, ends of their rays near, far and nowhere, what is known of the rays, and what ends send out."""
    random = np.random.default_rng(3)
    hits, ends, out = empty_hits(HITS), empty_hits(RAYS), room_for_lobes(RAYS, 0)
    hits.position[:] = random.random((HITS, 3))
    ends.kind[:] = np.where(np.arange(RAYS) % 4 == 3, ESCAPED, SURFACE)
    ends.position[:] = random.random((RAYS, 3)) * np.where(np.arange(RAYS) % 2 == 0, 1.0, 5.0)[:, None]
    ends.reflectivity[:], ends.specular[:] = random.random((2, RAYS, 3)) / 2
    out.place[:] = np.arange(RAYS) % (HITS - 1)  # the last hit has no ray
    out.weight[:], out.passed[:] = random.random(RAYS), random.random((RAYS, 3))
    out.light[:] = out.constant[:] = out.share[:] = 0.0
    np.add.at(out.share, out.place, out.weight)
    return hits, ends, out, random.random((RAYS, 3)).astype(np.float32)


def test_lobes_bring_what_their_rays_meet_by_its_distance() -> None:
    hits, ends, out, glow = rays()
    expected, constant = np.zeros((2, HITS, 3))
    for k in range(RAYS):
        i, left = out.place[k], out.weight[k].astype(float) * out.passed[k]
        if ends.kind[k] == ESCAPED:
            constant[i] += left * BACKGROUND
            continue
        distance = np.linalg.norm(ends.position[k].astype(float) - hits.position[i])
        rho = min(np.sqrt(distance / RANGE), 1.0)
        expected[i] += rho * left * (ends.reflectivity[k] + ends.specular[k])
        constant[i] += left * glow[k]
    read_ambient(hits, ends, RAYS, glow, BACKGROUND, SETTINGS, out)
    complete_ambient(HITS, out)
    total = np.where(out.share[:HITS] > 0, out.share[:HITS], 1.0)[:, None]
    np.testing.assert_allclose(out.light[:HITS, COLOUR : COLOUR + 3], expected / total, rtol=1e-5)
    np.testing.assert_allclose(out.constant[:HITS], constant / total, rtol=1e-5)
    assert (expected[-1] == 0).all() and (expected[0] > 0).all()
