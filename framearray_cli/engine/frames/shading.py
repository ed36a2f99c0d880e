"""The phases of a batch of hits: what depends on their rays, then indirect light, direct light, and rows."""

from time import perf_counter

from framearray_cli.base.arrays import Float32

from ..hits.row import write_rows
from ..inputs.lights import LightArrays
from ..inputs.panes import has_panes
from ..terms.direct import direct
from ..terms.environments import gather_environments, has_environments, see_environments, with_gathering
from .setup import Batch


def record(batch: Batch) -> None:
    """Find what depends on the rays that found the hits, which are still in `scratch.hit_rays`."""
    for feature in batch.setup.features:
        feature.record(batch)


def shade(batch: Batch) -> None:
    """Estimate W, light-independent radiance and E[l] of a batch, and write its columns.

    What depends on the rays of the hits was recorded before.
    """
    started = perf_counter()
    setup, hits, n, scratch = batch.setup, batch.hits, batch.n, batch.scratch
    row, irradiance = batch.column("row"), batch.column("irradiance")
    skylight = setup.indirect.shade(batch)
    middle = perf_counter()
    for feature in setup.features:
        feature.begin(batch)
    batch.count("shadow", _estimate_direct(batch, irradiance))
    write_rows(hits, n, setup.background, scratch.obscurance, skylight, batch.throughput, irradiance, row)
    for feature in setup.features:
        feature.shade(batch)
    scratch.seconds[batch.kind("obscurance")] += middle - started
    scratch.seconds[batch.kind("shadow")] += perf_counter() - middle


def _estimate_direct(batch: Batch, irradiance: Float32) -> int:
    """Estimate E[l] of hits by all sources, one after the other if a feature keeps the light of each."""
    setup, hits, n, scratch = batch.setup, batch.hits, batch.n, batch.scratch
    keepers = [feature for feature in setup.features if feature.keeps_light]
    if scratch.by_source:
        rays = 0
        irradiance[:n] = 0.0
        for s, source in enumerate(scratch.by_source):
            if source.lit[s].any():
                rays += _drawn(batch, source, scratch.of_source)
                for feature in keepers:
                    feature.keep_light(batch, scratch.of_source, s)
                irradiance[:n] += scratch.of_source[:n]
    else:
        rays = _drawn(batch, setup.lights, irradiance)
        for feature in keepers:
            feature.keep_light(batch, irradiance, 0)
    if has_environments(setup.lights):
        if not has_panes(setup.world.panes):
            rays += gather_environments(
                hits, n, with_gathering(setup.lights), setup.world.tracer, scratch.test_rays, irradiance
            )
        see_environments(hits, n, setup.lights, scratch.test_rays, irradiance)
    return rays


def _drawn(batch: Batch, lights: LightArrays, irradiance: Float32) -> int:
    """Estimate E[l] of the points that hits draw of sources."""
    world, tests = batch.setup.world, batch.scratch.test_rays
    lights = with_gathering(lights) if has_environments(lights) and not has_panes(world.panes) else lights
    rays: int = direct(batch.hits, batch.n, lights, world.sight, tests, irradiance, not batch.mirrored)
    return rays
