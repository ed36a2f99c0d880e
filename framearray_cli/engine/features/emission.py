"""Light that hits send out themselves: surfaces of area lights, and emission that no source of the job lists."""

import numpy as np

from framearray_cli.base.arrays import Float32

from ..embree.packets import DIRECTION, MISS, Tracer, U, V, hit_triangle
from ..frames.records import Column, HitRecords, StoredLight
from ..frames.setup import Batch, Feature, FrameSetup
from ..hits.row import LIGHT_INDEPENDENT
from ..inputs.emitters import Emitters, Glow
from ..inputs.lights import LightArrays
from ..inputs.surfaces import factors_at
from ..kernels.kernel import kernel
from ..kernels.simd import width_of_packets

# Columns of what a hit sends out: the source that it belongs to, -1 without, and its texture, RGB.
SOURCE, TEXTURE = 0, 1
EMISSION_COLUMNS = 4


class AreaLights(Feature):
    """Surfaces of sources that are meshes, which eyes and mirrors see: `accumulate` sums their light for all l."""

    name = "emission"

    def columns(self, light: StoredLight, *, mirrored: bool) -> tuple[Column, ...]:
        return (Column(self.name, (EMISSION_COLUMNS,)),)

    def room(self, setup: FrameSetup, batch: int) -> Float32:
        return np.empty((batch, EMISSION_COLUMNS), np.float32)

    def record(self, batch: Batch) -> None:
        setup, found = batch.setup, batch.room(self)[batch.first :]
        packets = batch.scratch.hit_rays.packets
        record_emission(setup.lights.emitters, setup.world.tracer, packets, batch.n, found)

    def shade(self, batch: Batch) -> None:
        n, out = batch.n, batch.column(self.name)
        out[:n] = batch.room(self)[:n]
        if batch.mirrored:
            out[:n, TEXTURE:] *= batch.throughput[:n]
        if batch.by_lobe:  # composing finds by itself what a lobe reflects of sources
            out[:n, SOURCE] = -1.0


def own_light(records: HitRecords, lights: LightArrays) -> Float32:
    """Radiance that hits on area lights send out, (n, n_lights, 3); (n, 1, 3) zeros in a scene without."""
    if AreaLights.name not in records:
        return np.zeros((len(records.row), 1, 3), np.float32)
    emission = records[AreaLights.name]
    source = emission[:, SOURCE].astype(np.int64)
    radiance = np.swapaxes(lights.strength, 1, 2)[np.maximum(source, 0)] * lights.colour
    found: Float32 = radiance * emission[:, None, TEXTURE:]
    return found


class UnlistedEmission(Feature):
    """Surfaces that send out light although no source of the job names them: they are seen, and light nothing."""

    name = "unlisted emission"

    def __init__(self, glow: Glow) -> None:
        self.glow = glow

    def room(self, setup: FrameSetup, batch: int) -> Float32:
        return np.empty((batch, 3), np.float32)

    def record(self, batch: Batch) -> None:
        n, found = batch.n, np.empty((batch.n, EMISSION_COLUMNS), np.float32)
        packets = batch.scratch.hit_rays.packets
        record_emission(self.glow.emitters, batch.setup.world.tracer, packets, n, found)
        radiance = self.glow.radiance[found[:, SOURCE].astype(np.int64)]  # of any where the texture is 0
        np.multiply(radiance, found[:, TEXTURE:], out=batch.room(self)[batch.first : batch.first + n])

    def shade(self, batch: Batch) -> None:
        n, row, radiance = batch.n, batch.column("row"), batch.room(self)
        seen = radiance[:n] * batch.throughput[:n] if batch.mirrored else radiance[:n]
        row[:n, LIGHT_INDEPENDENT : LIGHT_INDEPENDENT + 3] += seen


@kernel
def record_emission(emitters: Emitters, tracer: Tracer, packets: Float32, n: int, emission: Float32) -> None:
    """Find what traced rays 0 to n - 1 meet that shines on the side that they come from.

    Args:
        emission: (>= n, EMISSION_COLUMNS) overwritten; the texture is 0 where nothing shines.
    """
    surfaces, width = emitters.surfaces, width_of_packets()
    for i in range(n):
        emission[i, SOURCE] = -1.0
        emission[i, TEXTURE] = emission[i, TEXTURE + 1] = emission[i, TEXTURE + 2] = 0.0
        triangle = hit_triangle(tracer, packets, i)
        if triangle == MISS:
            continue
        material = surfaces.material[triangle]
        s = emitters.source[material]
        if s < 0:
            continue
        p, lane = i // width, i % width
        if emitters.back[s] > 0.0:
            # the front is where corners run counter-clockwise
            a, b, c = surfaces.corners[triangle, 0], surfaces.corners[triangle, 1], surfaces.corners[triangle, 2]
            x, y, z = np.float64(b[0]) - a[0], np.float64(b[1]) - a[1], np.float64(b[2]) - a[2]
            u, v, w = np.float64(c[0]) - a[0], np.float64(c[1]) - a[1], np.float64(c[2]) - a[2]
            towards = (y * w - z * v) * packets[p, DIRECTION, lane]
            towards += (z * u - x * w) * packets[p, DIRECTION + 1, lane]
            towards += (x * v - y * u) * packets[p, DIRECTION + 2, lane]
            if towards > 0.0:
                continue
        texture, at = emitters.texture[material], (packets[p, U, lane], packets[p, V, lane])
        red, green, blue, _ = factors_at(surfaces, texture, triangle, at[0], at[1])
        emission[i, SOURCE] = s
        emission[i, TEXTURE] = red
        emission[i, TEXTURE + 1] = green
        emission[i, TEXTURE + 2] = blue
