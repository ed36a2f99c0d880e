"""What finding and composing frames is given: arrays as kernels take them, and the settings of all terms."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from framearray_cli.base.arrays import Float64, Int32, Rgb
from framearray_cli.scene.paths.paths import Plane, first_with_background

from ..hits.gloss import gloss_columns
from ..hits.hits import World
from ..hits.native import pixel_order
from ..inputs.cameras import Cameras
from ..inputs.emitters import NO_GLOW, Glow, glows
from ..inputs.gloss import NO_GLOSS, Glossy
from ..inputs.lights import LightArrays
from ..inputs.marks import Marks
from ..inputs.panes import has_panes
from ..terms.cells.gather import LIGHT
from ..terms.cells.table import Cells, at_lights
from ..terms.obscurance import ObscuranceSettings
from ..terms.sun_hours import SunStudy
from .blocks import Allotment
from .passes import Pass, passes, passes_of_counts
from .records import BY_SAMPLE, HitRecords, empty_records, fresh_array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrameSetup:
    """What all frames of a path share, as kernels take it.

    Attributes:
        cams: all eyes c of the path.
        world: the scene.
        lights: light positions l.
        planes: contents of the image of each of them.
        n_r: N_r, the number of frames before and after a frame that share its hits.
        per_pixel: (n_c,) number n_c of native hits per pixel of every eye.
        mirror_hits: number of native hits of a pixel that sees a mirror, if more; 0 in a scene without mirrors.
        depth: number of mirror bounces to follow; 0 in a scene without mirrors.
        lobes: whether rays follow what glossy surfaces reflect, too.
        balance: whether hits are weighed by the balance heuristic; else all weigh 1.
        area: whether hits are weighed by the part of the pixel that they stand for, see `engine/images/area.py`.
        background: (3,) radiance outside the scene.
        layers: whether normals and depths are kept for the layers.
        allotment: native hits per block, where they differ; `per_pixel` then holds their means.
        halves: how hits are split into two halves: BY_SAMPLE, or the number of successive frames that belong to one
            half, or 0 for no split.
        cells: the light that indirect light is gathered from; None: obscurances.
        exact: whether paths take the place of `cells`, which then hold nothing, see `terms/cells/exact.py`.
        smooth: number of passes of the filter of indirect light from cells.
        sun: whose hours the layers hold; None: of none.
        marks: what else of hits the layers hold; None: nothing.
        alpha: whether what lies outside the scene is left out where eyes see it, and coverage kept.
        glossy: the gloss of all materials; `glow`: what they send out without being sources.
        order: (n_pixels,) every pixel once, in the order of tracing.
    """

    cams: Cameras
    world: World
    lights: LightArrays
    planes: tuple[Plane, ...]
    obscurance: ObscuranceSettings
    seed: int
    n_r: int
    per_pixel: Float64
    mirror_hits: int
    depth: int
    balance: bool
    background: Rgb
    layers: bool
    halves: int = 0
    area: bool = False
    allotment: Allotment | None = None
    cells: Cells | None = None
    exact: bool = False
    smooth: int = 0
    sun: SunStudy | None = None
    marks: Marks | None = None
    alpha: bool = False
    glossy: Glossy = NO_GLOSS
    glow: Glow = NO_GLOW
    lobes: bool = False
    order: Int32 = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "order", pixel_order(self.cams.width, self.cams.height))

    @property
    def n_frames(self) -> int:
        return len(self.per_pixel)

    @property
    def n_pixels(self) -> int:
        return self.cams.width * self.cams.height

    def passes(self, c: int) -> tuple[Pass, ...]:
        """The native hits of eye c."""
        if self.allotment is not None:
            return passes_of_counts(self.order, self.allotment.counts(c))
        return passes(self.order, self.cams.width, c, float(self.per_pixel[c]))

    def fewest_hits(self, c: int) -> int:
        """The number of native hits that every pixel of eye c has at least."""
        return int(self.per_pixel[c] if self.allotment is None else self.allotment.counts(c).min())

    def half_of(self, c: int) -> int:
        """The half that all hits of eye c belong to, or BY_SAMPLE."""
        return c // self.halves % 2 if self.halves > 0 else BY_SAMPLE

    @property
    def light_independent_from(self) -> int:
        """The first plane with light-independent radiance; all that follow have it too."""
        return first_with_background(self.planes)

    @property
    def stored_light(self) -> tuple[int, int]:
        """The number of channels of irradiance and of light positions."""
        return self.lights.channels, self.lights.n_lights

    @property
    def shines(self) -> bool:
        """Whether any surface of the scene shines."""
        return self.lights.emitters.span.size > 0

    @property
    def glows(self) -> bool:
        """Whether any surface that is no source is seen shining."""
        return glows(self.glow)

    @property
    def has_glass(self) -> bool:
        """Whether any surface of the scene is thin glass."""
        return has_panes(self.world.panes)

    @property
    def names_panes(self) -> bool:
        """Whether mattes name panes of glass."""
        return self.marks is not None and self.marks.mattes and self.has_glass

    @property
    def shiny(self) -> bool:
        """Whether any surface of the scene is glossy."""
        return self.glossy.factor.ndim > 1

    @property
    def follows(self) -> bool:
        """Whether native hits may have reflected hits."""
        return self.depth > 0 or self.lobes

    @property
    def reads_lobes(self) -> bool:
        """Whether what wide lobes reflect is read where their rays end: from cells, or as ambient light without any."""
        return self.lobes and not self.exact

    def for_lights(self, block: range) -> "FrameSetup":
        """The setup for a block of light positions; their images stay the same to the last bit."""
        first = block.start == 0  # layers are written once
        return replace(
            self,
            layers=self.layers and first,
            sun=self.sun if first else None,
            marks=self.marks if first else None,
            lights=self.lights.at(block),
            planes=self.planes[block.start : block.stop],
            cells=self.cells_at(block),
        )

    def cells_at(self, positions: Sequence[int]) -> Cells | None:
        """The cells at some light positions; those of all are not copied."""
        if self.cells is None or list(positions) == list(range(self.lights.n_lights)):
            return self.cells
        return at_lights(self.cells, list(positions))

    def empty_records(self, n: int, take: Any = None, *, mirrored: bool = False) -> HitRecords:
        """Allocate records of n hits, seen in mirrors or not; see `empty_records` in `records.py`."""
        channels, n_lights = self.stored_light
        columns = 0 if self.cells is None else LIGHT + channels * n_lights
        days = len(self.sun.days) if self.sun else 0
        gloss = 0
        if self.shiny:
            n_sources = len(self.lights.kind)
            gloss = gloss_columns(n_sources, channels, n_lights, glass=self.has_glass, mirrored=mirrored)
        marks = self.marks.columns if self.marks and not mirrored else 0
        return empty_records(n, channels, n_lights, columns, self.shines, days, gloss, marks, take or fresh_array)

    def eyes_of(self, j: int) -> range:
        """The window of frame j: the eyes whose hits it shows."""
        return self.frames_around(j, self.n_r)

    def eyes_for(self, wanted: Sequence[int]) -> list[int]:
        """The eyes whose hits the wanted frames show, in rising order."""
        return sorted({c for j in wanted for c in self.eyes_of(j)})

    def frames_around(self, c: int, reach: int) -> range:
        """The frames of the path from c - reach to c + reach."""
        return range(max(c - reach, 0), min(c + reach, self.n_frames - 1) + 1)
