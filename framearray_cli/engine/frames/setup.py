"""Setup of frames, and the base class of features: parts of a job that own columns of hits.

A hit is a row, and a feature owns some of its columns. Each batch of hits passes through the phases of all features,
in their order, so that hits, records, memory and layers follow from the list of features of a job.
"""

import math
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Literal, NamedTuple, Self, TypeAlias, TypeVar

import numpy as np

from framearray_cli.base.arrays import Addresses, Float32, Float64, Int32, Rgb, with_room
from framearray_cli.scene.paths.paths import Plane, first_with_background

from ..hits.hits import Hits, World, empty_hits
from ..hits.native import TILE, pixel_order
from ..hits.rays import room_for_hits, room_for_tests
from ..hits.row import BY_SAMPLE
from ..inputs.cameras import OUTSIDE, Cameras
from ..inputs.lights import LightArrays
from ..kernels.simd import LANES
from ..terms.cells.lookup import Cells
from ..terms.obscurance import ObscuranceSettings
from .passes import Allotment, Pass, passes, passes_of_counts, repeated, repetitions
from .records import (
    ADDRESS,
    ROW,
    Column,
    FrameHits,
    HitRecords,
    StoredLight,
    Take,
    empty_records,
    fresh_array,
    light_columns,
)

Weights: TypeAlias = Literal["average", "balance", "area"]
# Pixels and records of reflected hits, and the number of the span of hits that they belong to.
Reflected: TypeAlias = tuple[int, Int32, HitRecords]
F = TypeVar("F", bound="Feature")

NO_TINT = np.empty((0, 3), np.float32)
# Rays traced together within a batch.
RAYS = 4096


class Feature:
    """A part of a job: it owns columns of hits, and acts in the phases of a batch and of a frame.

    One object serves all threads. Each method is a no-op unless a feature overrides it.

    Attributes:
        name: of its room in `Scratch`, unique.
        is_layer: True if it only makes layers, which are written once and not for each light position.
        follows: True if it has reflected hits.
        keeps_light: True if it needs the irradiance of each source by itself.
        shadow_rays: number of shadow rays of its own per hit.
        layer_bytes: bytes per pixel of its layers.
    """

    name: ClassVar[str]
    is_layer: ClassVar[bool] = False
    follows: bool = False
    keeps_light: ClassVar[bool] = False
    shadow_rays: int = 0
    layer_bytes: int = 0

    def columns(self, light: StoredLight, *, mirrored: bool) -> tuple[Column, ...]:
        """The columns that it owns of native hits, or of reflected ones."""
        return ()

    def frame_columns(self) -> tuple[Column, ...]:
        """The columns that it owns of native hits in each frame that may see them."""
        return ()

    def room(self, setup: "FrameSetup", batch: int) -> Any:
        """Allocate the arrays of one thread for batches of hits; see `Scratch.rooms`."""
        return None

    def record(self, batch: "Batch") -> None:
        """Find what depends on the rays that found the hits, which are still in `scratch.hit_rays`."""

    def begin(self, batch: "Batch") -> None:
        """Begin the columns of hits whose light comes next."""

    def keep_light(self, batch: "Batch", irradiance: Float32, s: int) -> None:
        """Keep the irradiance of source s, or of all if there is only one."""

    def shade(self, batch: "Batch") -> None:
        """Complete the columns of hits whose light and rows are known."""

    def see(self, batch: "Batch", frames: range, pixel: Int32, columns: Mapping[str, Any]) -> None:
        """Write `frame_columns` of hits of each of some frames.

        Args:
            pixel: (n_frames, n) the pixel of each frame that sees a hit, or OUTSIDE.
            columns: (n_frames, n, *shape) of all features.
        """

    def bounces(self, batch: "Batch", passed: Rgb, ends: list[int]) -> Iterator[Reflected]:
        """Find the reflected hits of native hits.

        Args:
            passed: (n, 3) what passes on the way to the hits.
            ends: span k has hits ends[k] to ends[k + 1] - 1, which are reflected together.
        """
        return iter(())

    def show(self, hits: FrameHits, j: int) -> None:
        """Change the records of hits to what frame j sees, which is composed next."""

    def composer(self, frame: FrameHits, shown: range) -> "Composer | None":
        """The layers that the feature adds to the composed frame of an eye, in some pixels of the zone."""
        return None


class PixelTask(NamedTuple):
    """Pixels first to first + n - 1 of those that are composed.

    Attributes:
        hits: addresses of a `SourceList` with native and outer hits, with the weights that images have.
        columns: name -> column of `hits` with the addresses of that column of hits.
    """

    hits: Addresses
    columns: Mapping[str, int]
    first: int
    n: int


class Composer:
    """Composes a feature's part of a frame; several threads call `compose`, each for other pixels.

    Attributes:
        row: columns of rows whose weighted means the feature needs, see `hits/row.py`.
    """

    row: tuple[int, ...] = ()

    def compose(self, task: PixelTask) -> None:
        """Compose some pixels."""

    def layers(self, means: Float32, samples: Int32, shape: tuple[int, ...]) -> Mapping[str, Any]:
        """The layers by name, see `Composed`.

        Args:
            means: (n_pixels, len(row)).
            samples: (n_pixels,) number of hits of each pixel.
            shape: height and width.
        """
        return {}


class Indirect:
    """A method of indirect light: one of `features/indirect.py`.

    Attributes:
        settings: of the rays of W.
        ambient: True if images add I_A R W; else hits have a column of light.
        cells: whose light is read; None unless it is.
        reads_lobes: True if what wide lobes reflect is read where their rays end.
    """

    ambient: ClassVar[bool] = False
    reads_lobes: ClassVar[bool] = True
    settings: ObscuranceSettings
    cells: Cells | None = None

    @staticmethod
    def columns(light: StoredLight) -> tuple[Column, ...]:
        """The columns of hits; none if images add I_A R W."""
        return ()

    def room(self, setup: "FrameSetup", batch: int, rays: int) -> Any:
        """Allocate the arrays of one thread, for batches of hits and packets of rays."""
        raise NotImplementedError

    def shade(self, batch: "Batch") -> Rgb:
        """Estimate W and indirect light of a batch; return the radiance that arrives under every light, or (0, 3)."""
        raise NotImplementedError

    def read_lobes(self, batch: "Batch", ends: Hits, m: int, alpha: Float32, glow: Rgb, out: Any) -> None:
        """Add what rays 0 to m - 1 of lobes find at their ends to the sums of their hits; see `LobeLight`."""
        raise NotImplementedError

    def complete_lobes(self, batch: "Batch", out: Any) -> None:
        """Turn sums of lobes into means, smoothed if the light of hits is."""
        raise NotImplementedError

    def at(self, positions: Sequence[int]) -> Self:
        """The same at some of the light positions."""
        return self

    def with_settings(self, settings: ObscuranceSettings) -> Self:
        """The same with other rays of W."""
        found: Self = replace(self, settings=settings)  # type: ignore[type-var]  # all methods are dataclasses
        return found


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Strip:
    """Rows of all frames that are rendered by themselves, because the hits of whole frames do not fit into memory.

    Attributes:
        rows: from a multiple of `TILE` to another one, or to the last row.
        reached: the rows in which frames show the chunks of hits of an eye, by the eye and the first hit of a pass; see
            `reach.py`. All strips share it.
    """

    rows: range
    reached: dict[tuple[int, int], Int32] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrameSetup:
    """Arrays and settings that all frames of a path share, in the form that kernels read.

    Attributes:
        cams: all eyes c of the path.
        world: the scene.
        lights: light positions l; `planes`: what the image of each holds.
        background: (3,) radiance outside the scene.
        seed: of the job.
        n_r: N_r, the number of frames before and after a frame that share its hits.
        weights: how hits are weighed in a frame.
        per_pixel: (n_c,) number n_c of native hits per pixel of every eye, and of each eye that repeats it.
        allotment: native hits per block, where they differ; `per_pixel` then holds their means.
        mirror_hits: number of native hits of a pixel that sees a mirror, if more; 0 in a scene without mirrors.
        depth: number of mirror bounces to follow; 0 in a scene without mirrors.
        halves: how hits are split into two halves: BY_SAMPLE, or the number of successive frames that belong to one
            half, or 0 for no split.
        indirect: how indirect light is found.
        features: all others of the job, in the order in which they act.
        strip: the rows of all frames to render; None: all.
    """

    cams: Cameras
    world: World
    lights: LightArrays
    planes: tuple[Plane, ...]
    background: Rgb
    seed: int
    n_r: int
    weights: Weights
    per_pixel: Float64
    mirror_hits: int
    depth: int
    indirect: Indirect
    halves: int = 0
    allotment: Allotment | None = None
    features: tuple[Feature, ...] = ()
    strip: Strip | None = None

    @property
    def order(self) -> Int32:
        """(n_pixels,) every pixel once, in the order of tracing."""
        return pixel_order(self.cams.width, self.cams.height)

    @property
    def n_frames(self) -> int:
        return len(self.per_pixel)

    @property
    def n_pixels(self) -> int:
        return self.cams.width * self.cams.height

    @property
    def rows(self) -> range:
        """The rows of images."""
        return self.strip.rows if self.strip else range(self.cams.height)

    @property
    def share(self) -> float:
        """Share of the frame's rows."""
        return len(self.rows) / self.cams.height

    @property
    def zone(self) -> range:
        """The rows whose hits are kept: of images, and the rows next to them where hits of these count, too."""
        more = int(self.area)
        return range(max(self.rows.start - more, 0), min(self.rows.stop + more, self.cams.height))

    @property
    def zone_size(self) -> tuple[int, int]:
        """Width and height of the zone, pixels; hits are listed by the pixels of the zone."""
        return self.cams.width, len(self.zone)

    @property
    def n_zone(self) -> int:
        """Number of pixels of the zone."""
        return self.cams.width * len(self.zone)

    def in_zone(self, pixel: Int32) -> Int32:
        """Pixels of a frame as pixels of the zone; OUTSIDE if they are not in it."""
        first = self.zone.start * self.cams.width
        inside = (pixel >= first) & (pixel < first + self.n_zone)
        return np.where(inside, pixel - first, np.int32(OUTSIDE)) if self.strip else pixel

    def tile_rows(self, pixels: Int32) -> tuple[Int32, ...]:
        """The pixels in the rows of images, one row of tiles after the other; strips end where these do.

        Args:
            pixels: in the order of tracing.
        """
        row = pixels // (self.cams.width * TILE)
        tiles = range(self.rows.start // TILE, -(-self.rows.stop // TILE))
        return tuple(pixels[slice(*np.searchsorted(row, (k, k + 1)))] for k in tiles)

    @property
    def area(self) -> bool:
        """True if hits are weighed by the part of the pixel that they stand for, see `images/area.py`."""
        return self.weights == "area"

    @property
    def balance(self) -> bool:
        """True if hits are weighed by the balance heuristic; else each counts as 1."""
        return self.weights != "average" and self.n_r > 0

    def feature(self, kind: type[F]) -> F | None:
        """The feature of a kind, if the job has it."""
        return next((feature for feature in self.features if isinstance(feature, kind)), None)

    @property
    def extended(self) -> bool:
        """True if eyes before and after the path repeat its frames, see `passes.py`; an allotment needs none."""
        return self.n_r > 0 and self.allotment is None

    def frame_of(self, eye: int) -> int:
        """The frame that an eye is, or repeats."""
        return repeated(eye, self.n_frames)

    def passes(self, eye: int) -> tuple[Pass, ...]:
        """The native hits of an eye."""
        c = self.frame_of(eye)
        if self.allotment is not None:
            return passes_of_counts(self.order, self.allotment.counts(c))
        earlier = repetitions(c, self.n_frames, self.n_r).index(eye)
        per_pixel = float(self.per_pixel[c])
        return passes(self.order, self.cams.width, eye, per_pixel, earlier * math.ceil(per_pixel))

    def unused_sample(self, c: int) -> int:
        """The first sample that no native hits of frame c, and of eyes that repeat it, have used."""
        if self.allotment is not None:
            return int(self.allotment.counts(c).max())
        eyes = len(repetitions(c, self.n_frames, self.n_r)) if self.extended else 1
        return eyes * math.ceil(float(self.per_pixel[c]))

    def hits_in(self, frames: range, eyes: range) -> Float64:
        """Native hits per pixel of each eye that count in some frames, with eyes that repeat it, (n_frames, n_eyes).

        An allotment has other hits in each block; all of its eyes count as 1.
        """
        found = np.zeros((len(frames), len(eyes)))
        for row, j in enumerate(frames):
            for eye in self.eyes_of(j):
                c = self.frame_of(eye)
                found[row, c - eyes.start] += self.per_pixel[c] if self.allotment is None else 1.0
        return found

    def fewest_hits(self, c: int) -> int:
        """The number of native hits that every pixel of eye c has at least."""
        return int(self.per_pixel[c] if self.allotment is None else self.allotment.counts(c).min())

    def half_of(self, eye: int) -> int:
        """The half that all hits of an eye belong to, or BY_SAMPLE."""
        return eye // self.halves % 2 if self.halves > 0 else BY_SAMPLE

    @property
    def light_independent_from(self) -> int:
        """The first plane with light-independent radiance; all that follow have it too."""
        return first_with_background(self.planes)

    @property
    def stored(self) -> StoredLight:
        """The size of the light that a hit keeps."""
        return StoredLight(len(self.lights.kind), self.lights.channels, self.lights.n_lights)

    @property
    def follows(self) -> bool:
        """True if native hits may have reflected hits."""
        return self.depth > 0 or any(feature.follows for feature in self.features)

    @property
    def has_layers(self) -> bool:
        """True if frames have layers."""
        return any(feature.is_layer for feature in self.features)

    def columns(self, *, mirrored: bool = False) -> tuple[Column, ...]:
        """All columns of a batch of native or of reflected hits."""
        return record_columns(self.indirect.columns(self.stored), self.features, self.stored, mirrored=mirrored)

    def frame_columns(self) -> tuple[Column, ...]:
        """All columns of native hits in each frame that may see them."""
        return frame_columns(self.features, balance=self.balance, area=self.area)

    def kept_columns(self, *, mirrored: bool = False) -> tuple[Column, ...]:
        """All columns that are kept of native or of reflected hits, whose light lies in a `LightStore`."""
        return kept_columns(self.features, self.stored, mirrored=mirrored)

    def packed_column(self, *, mirrored: bool = False) -> Column | None:
        """The packed column of native or of reflected hits; None if they have none."""
        return next((column for column in self.columns(mirrored=mirrored) if column.packed), None)

    def feature_columns(self) -> tuple[Column, ...]:
        """The frame columns of features alone."""
        return frame_columns(self.features, balance=False, area=False)

    def empty_records(self, n: int, take: Take = fresh_array, *, mirrored: bool = False) -> HitRecords:
        """Allocate all columns of n hits, native or reflected."""
        return empty_records(self.columns(mirrored=mirrored), n, take)

    def at(self, positions: Sequence[int]) -> "FrameSetup":
        """The setup at some of its light positions; their images stay the same to the last bit."""
        if list(positions) == list(range(self.lights.n_lights)):
            return self
        return replace(
            self,
            lights=self.lights.at(positions),
            planes=tuple(self.planes[p] for p in positions),
            indirect=self.indirect.at(positions),
        )

    def without_layers(self) -> "FrameSetup":
        """The setup for images alone."""
        return replace(self, features=tuple(feature for feature in self.features if not feature.is_layer))

    def for_block(self, block: range) -> "FrameSetup":
        """The setup for a block of light positions; the first block has the layers, which are written once."""
        return (self if block.start == 0 else self.without_layers()).at(block)

    def eyes_of(self, j: int) -> range:
        """The window of frame j: the eyes whose hits it shows."""
        return range(j - self.n_r, j + self.n_r + 1) if self.extended else self.frames_around(j, self.n_r)

    def eyes_for(self, wanted: Sequence[int]) -> list[int]:
        """The eyes whose hits the wanted frames show, in rising order."""
        return sorted({eye for j in wanted for eye in self.eyes_of(j)})

    def frames_around(self, eye: int, reach: int) -> range:
        """The frames of the path at most `reach` away from an eye."""
        return range(max(eye - reach, 0), min(eye + reach, self.n_frames - 1) + 1)


def record_columns(
    indirect: tuple[Column, ...], features: Sequence[Feature], light: StoredLight, *, mirrored: bool = False
) -> tuple[Column, ...]:
    """All columns of a batch of native or of reflected hits."""
    return (*light_columns(light), *indirect, *columns_of(features, light, mirrored=mirrored))


def columns_of(features: Sequence[Feature], light: StoredLight, *, mirrored: bool = False) -> tuple[Column, ...]:
    """All columns of native or of reflected hits that features own."""
    return tuple(column for feature in features for column in feature.columns(light, mirrored=mirrored))


def kept_columns(features: Sequence[Feature], light: StoredLight, *, mirrored: bool = False) -> tuple[Column, ...]:
    """All columns that are kept of every hit: row, address of the light, and columns of features."""
    own = columns_of(features, light, mirrored=mirrored)
    return ROW, ADDRESS, *(column for column in own if not column.packed)


def frame_columns(features: Sequence[Feature], *, balance: bool, area: bool) -> tuple[Column, ...]:
    """All columns of native hits in each frame that may see them: weight w, sub-pixel, and columns of features."""
    weight = (Column("weight"),) if balance else ()
    subpixel = (Column("subpixel", (), np.uint8),) if area else ()
    return (*weight, *subpixel, *(column for feature in features for column in feature.frame_columns()))


class Scratch:
    """One thread's arrays and counters, kept from batch to batch.

    Attributes:
        hit_rays, test_rays: packets of rays that find hits, and of rays that are only tested for being blocked.
        hits: the batch.
        reflected, throughput: reflected hits and the tint of the mirrors on the way, of this bounce and the last one.
        pixel, density: (4 N_r + 1, batch) of the eyes around, see `outer_hits`.
        weight, subpixel: (2 N_r + 1, batch) of hits in the frames around.
        obscurance: (batch, 3) W.
        by_source: the lights with one source at a time, if a feature needs the light of each; else empty.
        of_source: (batch, channels, n_lights) irradiance of one source, or no rows.
        light: (batch, *shape) E[l] and indirect light by the names of their columns, before they are kept.
        indirect: room of the indirect light; `rooms`: rooms of features, by their names.
        rays: number of rays traced by kind; `seconds`: by stage.
    """

    def __init__(self, setup: FrameSetup, batch: int) -> None:
        n_eyes = 4 * setup.n_r + 1  # the windows of all frames that see a hit of eye c
        rays = max(RAYS, batch, setup.indirect.settings.n_rays)
        self.hit_rays = room_for_hits(rays)
        self.test_rays = room_for_tests(RAYS, setup.lights.n_lights)
        self.hits = empty_hits(batch)
        # kernels write sixteen hits at a time, here from any hit on
        self.reflected = [empty_hits(batch + LANES) for _ in range(2 if setup.follows else 0)]
        self.throughput = [np.empty((batch, 3), np.float32) for _ in self.reflected]
        self.pixel = np.empty((n_eyes, batch), np.int32)
        self.subpixel = np.empty((2 * setup.n_r + 1, batch if setup.area else 0), np.int32)
        self.density = np.empty((n_eyes, batch if setup.balance else 0), np.float64)
        self.weight = np.empty((2 * setup.n_r + 1, batch if setup.balance else 0), np.float32)
        self.obscurance = np.empty((batch, 3), np.float32)
        light = setup.stored
        apart = light.n_sources > 1 and any(feature.keeps_light for feature in setup.features)
        self.by_source = [setup.lights.of_source(s) for s in range(light.n_sources if apart else 0)]
        self.of_source = with_room((batch if apart else 0, light.channels, light.n_lights), np.float32)
        loose = [column for column in setup.columns() if column not in setup.kept_columns()]
        self.light = empty_records(loose, batch)
        self.indirect = setup.indirect.room(setup, batch, rays)
        self.rooms = {feature.name: feature.room(setup, batch) for feature in setup.features}
        self.rays: Counter[str] = Counter()
        self.seconds: defaultdict[str, float] = defaultdict(float)


@dataclass(slots=True, kw_only=True, eq=False)
class Batch:
    """Hits that one thread works on: hits 0 to n - 1 of some, with their slice of the columns.

    Attributes:
        c: the eye.
        records: columns of the hits; None while their number is not known, behind mirrors.
        throughput: (>= n, 3) the tint t of the mirrors on the way to each hit, or (0, 3) without mirrors.
        first: number of the first hit in the rooms of features.
        by_lobe: True if rays of a lobe of a glossy surface found the hits.
        smooth: True if hits in a row are neighbours in the image, and their indirect light may be smoothed.
        pilot: True if the rays are counted as a pilot's.
    """

    setup: FrameSetup
    c: int
    hits: Hits
    n: int
    scratch: Scratch
    records: HitRecords | None = None
    throughput: Rgb = field(default_factory=lambda: NO_TINT)
    first: int = 0
    by_lobe: bool = False
    smooth: bool = False
    pilot: bool = False

    @property
    def mirrored(self) -> bool:
        """True if mirrors show the hits; these lie apart, and they have fewer columns."""
        return len(self.throughput) > 0

    def owns(self, column: str) -> bool:
        """True if the hits have a column."""
        return self.records is not None and column in self.records

    def column(self, name: str) -> Any:
        """A column of the hits, which they have."""
        assert self.records is not None
        return self.records[name]

    def room(self, feature: Feature) -> Any:
        """The arrays of a feature."""
        return self.scratch.rooms[feature.name]

    def count(self, kind: str, rays: int) -> None:
        """Count rays of a kind: those behind mirrors and of pilots by themselves."""
        self.scratch.rays[self.kind(kind)] += rays

    def kind(self, kind: str) -> str:
        """The kind of rays, or stage, that this batch counts as."""
        return "pilot" if self.pilot else f"mirror {kind}" if self.mirrored else kind
