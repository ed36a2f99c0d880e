"""Glossy surfaces: what is kept of hits on them, so that composing finds the light that they send to any eye, and what
their lobes reflect.

Lobes are followed like mirrors, by one ray for some of their hits. What wide lobes reflect is read where their rays
end, see `terms/lobe_cells.py` and `terms/lobe_ambient.py`.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from framearray_cli.base.arrays import Float32, Int32, Rgb

from ..embree.packets import Tracer, decode_hits
from ..frames.bounces import Reflect, dim_reflected, follow
from ..frames.kept_light import direct_bytes
from ..frames.records import Column, HitRecords, StoredLight
from ..frames.setup import Batch, Feature, FrameSetup, Reflected
from ..hits.hits import ESCAPED, Hits, trace_hits
from ..hits.row import HALF, INDIRECT, LIGHT_INDEPENDENT, LIT, OBSCURANCE, REFLECTIVITY, WEIGHT
from ..inputs.gloss import DARKEST, WIDE, Glossy, coat_code, gloss_at
from ..kernels.bundle import allocated, rows_from
from ..kernels.kernel import has_rows, kernel
from ..kernels.simd import LANES, bits, lane_numbers, load, put_triples, select, store, triples_at
from ..terms.cells.gather import COLOUR
from ..terms.lobes import (
    RAYS_OF_LOBE,
    SHARPEST,
    LobeLight,
    Lobes,
    choose_lobes,
    follow_lobes,
    room_for_lobes,
    write_lobe,
)
from .emission import SOURCE, UnlistedEmission

# Columns of what is kept of glossy hits: alpha, 0 without gloss; metal, or `coat_code`; both halves of the key; point,
# shading and geometric normal; then LIT_WORDS, 16 bits per source and packet of light positions; in a scene with glass,
# which tints light, the irradiance of every source, channel and light position instead. Behind mirrors, then the
# direction to the viewer and t; else, in a scene with glass, the base colour, which tells what passes to an eye.
ALPHA, METAL, KEY, POINT, SHADING, GEOMETRIC, LIT_WORDS = 0, 1, 2, 4, 7, 10, 13
OF_MIRRORS, OF_GLASS = 6, 3


@dataclass(frozen=True, slots=True, eq=False)
class GlossRoom:
    """One thread's arrays.

    Attributes:
        native, reflected: lobes of native hits and of reflected ones.
        lobes: of what wide lobes reflect; None if their rays are followed.
    """

    native: Lobes
    reflected: Lobes
    lobes: LobeLight | None


class Gloss(Feature):
    """Glossy surfaces of a scene.

    Attributes:
        glossy: the gloss of all materials.
        glass: True if the scene has thin glass.
    """

    name = "gloss"
    keeps_light = True

    def __init__(self, glossy: Glossy, *, glass: bool, lobes: bool) -> None:
        """Describe the gloss of a scene.

        Args:
            lobes: True if rays follow what the surfaces reflect.
        """
        self.glossy, self.glass, self.follows = glossy, glass, lobes

    def columns(self, light: StoredLight, *, mirrored: bool) -> tuple[Column, ...]:
        kept = kept_words(light, glass=self.glass)
        more = OF_MIRRORS if mirrored else OF_GLASS * self.glass
        return (Column(self.name, (LIT_WORDS + kept + more,), packed=True),)

    def room(self, setup: FrameSetup, batch: int) -> GlossRoom:
        n = batch + LANES
        coated = n if len(self.glossy.coat) else 0
        native, reflected = (allocated(Lobes, alpha=n, metal=n, coat=coated, rough=coated) for _ in "nr")
        values = 0 if setup.indirect.ambient else setup.stored.values
        return GlossRoom(native, reflected, room_for_lobes(batch, values) if self.reads_lobes(setup) else None)

    def reads_lobes(self, setup: FrameSetup) -> bool:
        """True if what wide lobes reflect is read where their rays end."""
        return self.follows and setup.indirect.reads_lobes

    def record(self, batch: Batch) -> None:
        tracer, packets = batch.setup.world.tracer, batch.scratch.hit_rays.packets
        record_gloss(self.glossy, tracer, packets, batch.n, batch.hits, self._gloss(batch), batch.first)

    def begin(self, batch: Batch) -> None:
        lobes = self._gloss(batch)
        if batch.by_lobe:  # widen narrow lobes [Kaplanyan13]: few rays meet their highlights, as bright dots
            alpha, rough = lobes.alpha[: batch.n], lobes.rough[: batch.n]
            np.maximum(alpha, WIDE, out=alpha, where=alpha > 0)
            np.maximum(rough, WIDE**0.5, out=rough)
        keep_gloss(batch.hits, batch.n, lobes, batch.throughput, self.glass, batch.column(self.name))

    def keep_light(self, batch: Batch, irradiance: Float32, s: int) -> None:
        out = batch.column(self.name)
        if self.glass and len(batch.setup.lights.kind) > 1:
            keep_light(irradiance, batch.n, s, out)
        elif not self.glass:
            keep_lit(irradiance, batch.n, s, out.view(np.int32))

    def shade(self, batch: Batch) -> None:
        if batch.by_lobe:  # composing finds by itself what a lobe reflects of environments
            batch.column("row")[: batch.n, LIT][batch.hits.kind[: batch.n] == ESCAPED] = 0.0

    def bounces(self, batch: Batch, passed: Rgb, ends: list[int]) -> Iterator[Reflected]:
        if not self.follows:
            return
        found = self._gloss(batch)
        alpha, metal = found.alpha[: batch.n], found.metal[: batch.n]
        if len(self.glossy.coat):
            passed = passed.copy()
            choose_lobes(batch.hits, batch.n, found, self.glossy.albedo, passed)
        if self.reads_lobes(batch.setup):
            yield from self._wide_lobes(batch, passed, ends)
            alpha[alpha >= SHARPEST] = 0.0

        def by_lobes(first: int, last: int, to: Hits, tint: Rgb) -> int:
            some, packets = rows_from(batch.hits, first), batch.scratch.hit_rays.packets
            coat = alpha[first:last], metal[first:last], self.glossy.albedo
            return follow_lobes(some, last - first, passed[first:last], *coat, batch.setup.world, packets, to, tint)

        reflect: Reflect = by_lobes
        yield from follow(batch, ends, reflect, by_lobe=True)

    def _gloss(self, batch: Batch) -> Lobes:
        """The lobes of hits."""
        room: GlossRoom = batch.room(self)
        return room.reflected if batch.mirrored else room.native

    def _wide_lobes(self, batch: Batch, passed: Rgb, ends: list[int]) -> Iterator[Reflected]:
        """Find what wide lobes reflect of hits."""
        setup, scratch, hits, n = batch.setup, batch.scratch, batch.hits, ends[-1]
        lobes, reflected, packets = batch.room(self).lobes, scratch.reflected[0], scratch.hit_rays.packets
        alpha, metal = self._gloss(batch).alpha[:n], self._gloss(batch).metal[:n]
        unlisted = setup.feature(UnlistedEmission)
        for first, last in pairwise(ends):
            for ray in range(RAYS_OF_LOBE):
                m = write_lobe(hits, first, last, ray, alpha, metal, packets, reflected, lobes)
                if m == 0:
                    continue
                trace_hits(setup.world, packets, m, coherent=False, near=0.0, mirrors=True, hits=reflected)
                glow = np.empty((0, 3), np.float32)
                if unlisted is not None:
                    unlisted.record(Batch(setup=setup, c=batch.c, hits=reflected, n=m, scratch=scratch))
                    glow = batch.room(unlisted)
                dim_reflected(setup, scratch, m, lobes.passed)
                scratch.rays["mirror"] += m
                setup.indirect.read_lobes(batch, reflected, m, alpha, glow, lobes)
        setup.indirect.complete_lobes(batch, lobes)
        followed = np.flatnonzero(lobes.share[:n] > 0).astype(np.int32)
        records, pixels = self._records_of(batch, passed, followed, lobes), hits.pixel[followed]
        for k, (first, last) in enumerate(pairwise(np.searchsorted(followed, ends).tolist())):
            if first < last:
                yield k, pixels[first:last], records.part(slice(first, last))

    def _records_of(self, batch: Batch, passed: Rgb, followed: Int32, lobes: LobeLight) -> HitRecords:
        """Light that wide lobes of some hits reflect, as records of reflected hits."""
        setup, colour = batch.setup, slice(COLOUR, COLOUR + 3)
        records = setup.empty_records(len(followed), mirrored=True)
        tint, row = passed[followed] * lobes.tint[followed], records.row
        row[:] = 0.0
        row[:, WEIGHT] = 1.0
        row[:, REFLECTIVITY : REFLECTIVITY + 3] = tint
        row[:, LIGHT_INDEPENDENT : LIGHT_INDEPENDENT + 3] = tint * lobes.constant[followed]
        row[:, HALF] = batch.hits.half[followed]
        records.irradiance[:] = 0.0
        if setup.indirect.ambient:
            row[:, OBSCURANCE : OBSCURANCE + 3] = lobes.light[followed, colour]
            row[:, INDIRECT : INDIRECT + 3] = tint * lobes.light[followed, colour]
        else:
            records["indirect"][:] = lobes.light[followed]
        records[self.name][:, ALPHA] = 0.0
        if "emission" in records:
            records["emission"][:, SOURCE] = -1.0
        return records


@kernel
def record_gloss(of: Glossy, tracer: Tracer, packets: Float32, n: int, hits: Hits, out: Lobes, first: int) -> None:
    """Find how glossy the surfaces are that traced rays 0 to n - 1 meet; a base colour of them is at least DARKEST.

    Args:
        hits: of these rays; changes `reflectivity`.
        out: overwritten from row `first` on.
    """
    nothing = np.float32(0.0)
    for i in range(0, n, LANES):
        missed, triangle, u, v = decode_hits(tracer, packets, i)
        a, m, coat, rough = gloss_at(of, triangle, u, v)
        a = select(missed, nothing, a)
        store(out.alpha, first + i, a)
        store(out.metal, first + i, m)
        if has_rows(out.coat):
            store(out.coat, first + i, select(missed, nothing, coat))
            store(out.rough, first + i, rough)
        red, green, blue = triples_at(hits.reflectivity, i)
        least = select(a > nothing, DARKEST, nothing)
        put_triples(
            hits.reflectivity, i, select(red > least, red, least), select(green > least, green, least),
            select(blue > least, blue, least),
        )  # fmt: skip


@kernel
def keep_gloss(hits: Hits, n: int, lobes: Lobes, throughput: Rgb, glass: bool, out: Float32) -> None:
    """Write what is kept of hits 0 to n - 1, but for LIT_WORDS and what stands in its place, which becomes 0.

    Args:
        glass: whether the scene has any.
        throughput: (>= n, 3) the tint t of the mirrors on the way to each hit, or (0, 3) without mirrors.
        out: (n, columns) overwritten.
    """
    last = out.shape[1] - (OF_MIRRORS if throughput.shape[0] else (OF_GLASS if glass else 0))
    words, keys = out.view(np.int32), hits.key.view(np.int32)
    for i in range(n):
        out[i, ALPHA], out[i, METAL] = lobes.alpha[i], lobes.metal[i]
        if has_rows(lobes.coat) and lobes.coat[i] > np.float32(0.0):
            words[i, METAL] = coat_code(lobes.metal[i], lobes.coat[i], lobes.rough[i])
        words[i, KEY], words[i, KEY + 1] = keys[2 * i], keys[2 * i + 1]
        for axis in range(3):
            out[i, POINT + axis] = hits.position[i, axis]
            out[i, SHADING + axis] = hits.shading[i, axis]
            out[i, GEOMETRIC + axis] = hits.geometric[i, axis]
        for column in range(LIT_WORDS, last):
            words[i, column] = 0
        if throughput.shape[0]:
            x, y, z = hits.incoming[i, 0], hits.incoming[i, 1], hits.incoming[i, 2]
            scale = np.float32(-1.0) / np.sqrt(x * x + y * y + z * z)
            out[i, last], out[i, last + 1], out[i, last + 2] = scale * x, scale * y, scale * z
            for channel in range(3):
                out[i, last + 3 + channel] = throughput[i, channel]
        elif glass:
            for channel in range(3):
                out[i, last + channel] = hits.reflectivity[i, channel]


@kernel
def keep_lit(irradiance: Float32, n: int, s: int, out: Int32) -> None:
    """Set the bits of LIT_WORDS where source s gives light to hits 0 to n - 1.

    Args:
        irradiance: (>= n, channels, n_lights) of that source.
        out: (n, columns) what is kept, as integers.
    """
    channels, n_lights = irradiance.shape[1], irradiance.shape[2]
    first = s * ((n_lights + LANES - 1) // LANES)
    for i in range(n):
        for l in range(0, n_lights, LANES):
            lit = 0
            for channel in range(channels):
                lit |= bits(~(load(irradiance, (i * channels + channel) * n_lights + l) == np.float32(0.0)))
            if l + LANES > n_lights:  # the last packet reads beyond the end
                lit &= (1 << (n_lights - l)) - 1
            at = first + l // LANES
            out[i, LIT_WORDS + at // 2] |= np.int32(np.uint32(lit << (LANES * (at % 2))))


def kept_words(light: StoredLight, *, glass: bool) -> int:
    """The number of words after LIT_WORDS: bits; with glass the light of each of several sources."""
    if not glass:
        return -(-light.n_sources * -(-light.n_lights // LANES) // 2)
    return light.n_sources * direct_bytes(light) // 4 if light.n_sources > 1 else 0


@kernel
def keep_light(irradiance: Float32, n: int, s: int, out: Float32) -> None:
    """Keep what source s gives to hits 0 to n - 1, in a scene with glass and several sources.

    Args:
        irradiance: (>= n, channels, n_lights) of that source.
        out: (n, columns) what is kept.
    """
    channels, n_lights = irradiance.shape[1], irradiance.shape[2]
    n_words = channels * ((n_lights + LANES - 1) // LANES) * LANES
    for i in range(n):
        at = i * out.shape[1] + LIT_WORDS + s * n_words
        for l in range(0, n_lights, LANES):
            for channel in range(channels):
                e = load(irradiance, (i * channels + channel) * n_lights + l)
                store(out, at, select(lane_numbers() < np.int32(n_lights - l), e, np.float32(0.0)))
                at += LANES
