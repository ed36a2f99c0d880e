"""What the work on frames is given, and what it leaves: settings, records of hits, and where they fall."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from framearray_cli.base.arrays import Float64, Int32, Rgb
from framearray_cli.scene.paths.planes import Plane, first_with_background

from ..embree.packets import Tracer
from ..hits.hits import World
from ..hits.native import pixel_order
from ..inputs.cameras import Cameras
from ..inputs.lights import LightArrays, some_lights
from ..inputs.surfaces import Surfaces
from ..terms.obscurance import ObscuranceSettings
from .blocks import Allotment
from .passes import Pass, passes, passes_of_counts
from .records import BY_SAMPLE


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrameSetup:
    """Everything that the terms of every frame need, as kernels take it.

    Attributes:
        lights: those whose light is computed; `kept`: which of them are stored and composed.
        planes: what the image of each of these holds.
        per_pixel: (n_c,) native hits a pixel of every frame.
        mirror_hits: native hits of a pixel that sees a mirror, if more; 0 in a scene without mirrors.
        depth: mirror bounces that are followed; 0 in a scene without mirrors.
        balance: weights of hits by the balance heuristic, else all alike.
        background: (3,) radiance outside the scene.
        shadow_step, shadow_unbiased: see `terms/direct_steps.py`; step 1 tests every light position.
        layers: whether normals and depths are kept for the layers.
        denoise: whether W is denoised in composing.
        allotment: native hits by place, where they differ; `per_pixel` has their means then.
        halves: how hits are told apart in two halves: BY_SAMPLE, or so many frames of the camera path in turn belong
            to one half, or 0: not at all.
    """

    cams: Cameras
    surfaces: Surfaces
    tracer: Tracer
    lights: LightArrays
    kept: range
    planes: tuple[Plane, ...]
    obscurance: ObscuranceSettings
    seed: int
    n_r: int
    per_pixel: Float64
    mirror_hits: int
    depth: int
    balance: bool
    background: Rgb
    shadow_step: int
    shadow_unbiased: bool
    layers: bool
    denoise: bool = False
    halves: int = 0
    allotment: Allotment | None = None
    order: Int32 = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "order", pixel_order(self.cams.width, self.cams.height))

    @property
    def n_frames(self) -> int:
        return len(self.per_pixel)

    @property
    def n_pixels(self) -> int:
        return self.cams.width * self.cams.height

    @property
    def world(self) -> World:
        """What rays meet."""
        return World(self.surfaces, self.tracer)

    def passes(self, c: int) -> tuple[Pass, ...]:
        """The native hits of frame c."""
        if self.allotment is not None:
            return passes_of_counts(self.order, self.allotment.counts(c))
        return passes(self.order, self.cams.width, c, float(self.per_pixel[c]))

    def fewest_hits(self, c: int) -> int:
        """Native hits that every pixel of frame c has."""
        return int(self.per_pixel[c] if self.allotment is None else self.allotment.counts(c).min())

    def half_of(self, c: int) -> int:
        """The half that all hits of frame c belong to, or BY_SAMPLE."""
        return c // self.halves % 2 if self.halves > 0 else BY_SAMPLE

    @property
    def light_independent_from(self) -> int:
        """The first plane that holds what is the same under every light, as do all that follow it."""
        return first_with_background(self.planes)

    @property
    def stored_light(self) -> tuple[int, int]:
        """Channels of irradiance, and light positions whose irradiance is stored with a hit."""
        return self.lights.channels, len(self.kept)

    @property
    def keeps_all(self) -> bool:
        """Whether all light that is computed is stored too."""
        return len(self.kept) == self.lights.n_lights

    def for_lights(self, block: range) -> "FrameSetup":
        """The same setup for some light positions; their images are the same to the last bit.

        Shadow steps walk along the whole light path wherever a block ends, so all of it is computed, and some is kept.
        """
        planes = self.planes[block.start : block.stop]
        setup = replace(self, layers=self.layers and block.start == 0, planes=planes)
        if self.shadow_step > 1:
            return replace(setup, kept=block)
        return replace(setup, lights=some_lights(self.lights, block), kept=range(len(block)))

    def frames_for(self, wanted: Sequence[int]) -> list[int]:
        """The frames whose hits are needed to compose some frames, in rising order."""
        return sorted({k for j in wanted for k in self.frames_around(j, self.n_r)})

    def frames_around(self, c: int, reach: int) -> range:
        """The frames of the path from c - reach to c + reach."""
        return range(max(c - reach, 0), min(c + reach, self.n_frames - 1) + 1)
