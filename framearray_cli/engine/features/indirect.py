"""Methods of indirect light, one object each: obscurances, cells, or paths."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from framearray_cli.base.arrays import Float32, Rgb

from ..frames.records import Column, HitRecords, StoredLight
from ..frames.setup import Batch, FrameSetup, Indirect
from ..hits.hits import ESCAPED, Hits
from ..terms.cells.ends import (
    GatherScratch,
    MirrorScratch,
    NearHits,
    RayEnds,
    room_for_ends,
    room_for_mirrors,
    room_for_near,
)
from ..terms.cells.exact import PathScratch, light_of_paths
from ..terms.cells.gather import COLOUR, LEVEL, LIGHT, Gathered, gather_cells, gather_settings
from ..terms.cells.lookup import Cells
from ..terms.cells.smooth import SmoothScratch, room_for_smoothing, smooth_light
from ..terms.lobes import LobeLight, complete_ambient, complete_lobes, read_ambient, read_lobe
from ..terms.obscurance import RAYS_TOGETHER, ObscuranceSettings, obscurance

INDIRECT = "indirect"  # column of indirect light, see `Gathered`
NO_CLOSENESS = np.empty(0, np.float32)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CellRoom:
    """The arrays of one thread for light from cells.

    Attributes:
        skylight: (batch, 3) S, or (0, 3) unless rays of W see the background.
        constant: (batch, 3) light that is the same at every light position, and `closeness`: (batch,) of gather rays.
        ends, near, mirrors: scratch of gather rays, of rays too short for cells, and of rays that meet mirrors.
        smooth: scratch of the filter.
    """

    skylight: Rgb
    constant: Rgb
    closeness: Float32
    ends: RayEnds
    near: tuple[NearHits, NearHits]
    mirrors: MirrorScratch
    smooth: SmoothScratch


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PathRoom:
    """The arrays of one thread for light of paths: S, the light that is the same at every position, and scratch."""

    skylight: Rgb
    constant: Rgb
    paths: PathScratch


def _skylight(settings: ObscuranceSettings, batch: int) -> Rgb:
    """Allocate S, if rays of W see the background."""
    return np.empty((batch if settings.sky else 0, 3), np.float32)


def gathered(records: HitRecords) -> Float32:
    """Indirect irradiance that hits keep, in units of the lights' colour, (n, n_lights, 3)."""
    indirect = records[INDIRECT]
    known = np.where(indirect[:, LEVEL, None] > 0, indirect, np.float32(0.0))  # else not written
    by_light = np.swapaxes(known[:, LIGHT:].reshape(records.irradiance.shape), 1, 2)
    found: Float32 = by_light * known[:, None, COLOUR : COLOUR + 3]
    return found


def irradiance_of(records: HitRecords) -> Float32:
    """Direct irradiance of hits, and what they keep of indirect, in the lights' colour, (n, n_lights, 1 or 3)."""
    direct: Float32 = np.swapaxes(records.irradiance, 1, 2)
    return direct + gathered(records) if INDIRECT in records else direct


def _estimate_obscurance(settings: ObscuranceSettings, batch: Batch, skylight: Rgb) -> int:
    """Estimate W of a batch; return the number of rays."""
    world, scratch = batch.setup.world, batch.scratch
    rays: int = obscurance(
        batch.hits, batch.n, settings, world.surfaces, world.tracer, scratch.hit_rays, scratch.obscurance, skylight,
        not batch.mirrored,
    )  # fmt: skip
    return rays


@dataclass(frozen=True, eq=False)
class Obscurances(Indirect):
    """R (I_A W + S) [FA eq. 2]."""

    settings: ObscuranceSettings

    ambient = True

    def room(self, setup: FrameSetup, batch: int, rays: int) -> Rgb:
        return _skylight(self.settings, batch)

    def shade(self, batch: Batch) -> Rgb:
        skylight: Rgb = batch.scratch.indirect
        batch.count("obscurance", _estimate_obscurance(self.settings, batch, skylight))
        return skylight

    def read_lobes(self, batch: Batch, ends: Hits, m: int, alpha: Float32, glow: Rgb, out: LobeLight) -> None:
        read_ambient(batch.hits, ends, m, glow, batch.setup.background, self.settings, out)

    def complete_lobes(self, batch: Batch, out: LobeLight) -> None:
        complete_ambient(batch.n, out)


@dataclass(frozen=True, eq=False, kw_only=True)
class CellLight(Indirect):
    """Light that gather rays read from cells.

    Attributes:
        cells: at all light positions of a setup.
        smooth: number of passes of the filter of indirect light.
    """

    settings: ObscuranceSettings
    cells: Cells
    smooth: int

    @staticmethod
    def columns(light: StoredLight) -> tuple[Column, ...]:
        return (Column(INDIRECT, (LIGHT + light.values,)),)

    def room(self, setup: FrameSetup, batch: int, rays: int) -> CellRoom:
        light, count = setup.stored, (setup.lights.channels, setup.lights.n_lights)
        return CellRoom(
            skylight=_skylight(self.settings, batch),
            constant=np.empty((batch, 3), np.float32),
            closeness=np.empty(batch, np.float32),
            ends=room_for_ends(rays),
            near=(room_for_near(*count), room_for_near(*count)),
            mirrors=room_for_mirrors(min(rays, RAYS_TOGETHER), setup.depth),
            smooth=room_for_smoothing(light.values if self.smooth else 0),
        )

    def shade(self, batch: Batch) -> Rgb:
        setup, scratch, room = batch.setup, batch.scratch, self._room(batch)
        light = batch.column(INDIRECT)
        out = Gathered(scratch.obscurance, room.skylight, light, room.constant, room.closeness)
        gather = GatherScratch(scratch.hit_rays, room.ends, scratch.test_rays, *room.near, room.mirrors)
        rays = gather_cells(
            batch.hits, batch.n, gather_settings(self.settings), setup.world, setup.lights, self.cells, gather, out,
            not batch.mirrored,
        )  # fmt: skip
        batch.count("obscurance", rays)
        self._smooth(batch, batch.hits, room.closeness, light, room.constant)
        return room.constant

    def read_lobes(self, batch: Batch, ends: Hits, m: int, alpha: Float32, glow: Rgb, out: LobeLight) -> None:
        scratch, tracer = batch.scratch, batch.setup.world.tracer
        scratch.rays["mirror obscurance"] += read_lobe(
            batch.hits, ends, m, alpha, glow, self.cells, tracer, scratch.test_rays, out
        )

    def complete_lobes(self, batch: Batch, out: LobeLight) -> None:
        hits = batch.hits
        complete_lobes(batch.n, self.cells, out)
        only = hits._replace(kind=np.where(out.share[: len(hits.kind)] > 0, hits.kind, np.uint8(ESCAPED)))
        self._smooth(batch, only, out.closeness, out.light, out.constant)

    def _smooth(self, batch: Batch, hits: Hits, closeness: Float32, light: Float32, constant: Rgb) -> None:
        """Smooth light of hits that are neighbours in the image; see `smooth_light`."""
        if batch.smooth and self.smooth:
            cams, room = batch.setup.cams, self._room(batch).smooth
            smooth_light(hits, batch.n, cams.width, cams.height, self.smooth, closeness, room, light, constant)

    def at(self, positions: Sequence[int]) -> Self:
        return replace(self, cells=self.cells.at(list(positions)))

    def _room(self, batch: Batch) -> CellRoom:
        room: CellRoom = batch.scratch.indirect
        return room


@dataclass(frozen=True, eq=False)
class PathLight(Indirect):
    """Light of paths from each hit, the accurate method."""

    settings: ObscuranceSettings

    reads_lobes = False

    @staticmethod
    def columns(light: StoredLight) -> tuple[Column, ...]:
        return (Column(INDIRECT, (LIGHT + light.values,)),)

    def room(self, setup: FrameSetup, batch: int, rays: int) -> PathRoom:
        return PathRoom(
            skylight=_skylight(self.settings, batch),
            constant=np.empty((batch, 3), np.float32),
            paths=PathScratch(setup.lights),
        )

    def shade(self, batch: Batch) -> Rgb:
        setup, scratch = batch.setup, batch.scratch
        room: PathRoom = scratch.indirect
        rays = _estimate_obscurance(self.settings, batch, room.skylight)
        out = Gathered(scratch.obscurance, room.skylight, batch.column(INDIRECT), room.constant, NO_CLOSENESS)
        rays += light_of_paths(
            batch.hits, batch.n, self.settings.n_rays, setup.world, setup.lights, setup.background, room.paths, out
        )
        batch.count("obscurance", rays)
        return room.constant
