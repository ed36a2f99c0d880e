"""The pace of a render: processor time by kind of work, and from it the time left.

Images come neither evenly nor from the start: the first one waits for the hits of N_r + 1 eyes, then each eye
completes a frame with all its light positions at once, while threads write the frame before. So the time left is not
images over images per second. It is the work left, hits to find, planes to compose and images to write, at what each
has cost in processor time so far, over the number of processors kept busy.
"""

import math
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from framearray_cli.engine.frames.setup import FrameSetup

from .automatic import ADD, EYE_RAY, LOOK_UP, STORE

# Weight of the expected number of busy processors next to the measured one, seconds.
EXPECTED_SECONDS = 0.1
# Seconds after which an older measurement of busy processors counts 1 / e: others may use the machine, too.
MEMORY = 30.0
# Nanoseconds of processor time per obscurance ray, per shadow ray, and per frame in which a hit is looked for. They
# are of today, in the three jobs; the ones of `automatic/cost.py` stay, because they choose settings.
OBSCURANCE_RAY, SHADOW_RAY, VIEW = 115.0, 21.0, 110.0
# Processor time of composing, beyond what the model of `automatic/cost.py` expects: 2.0 to 2.7 in the three jobs.
COMPOSING = 2.2
# Nanoseconds of weighing by area, per pixel and per hit in it.
AREA_PIXEL, AREA_HIT = 150.0, 35.0
# Sums of hits are rounded.
NEARLY = 1.0 - 1e-9
# Processor time of writing the layers of a frame, over an image's, before any were written.
LAYERS = 4.0


class Work(NamedTuple):
    """An amount of work: native hits to find, planes of frames to compose, images and layers of frames to write.

    Hits count as many times as they cost what one costs that no other frame shares.
    """

    hits: float
    planes: float
    images: float
    layers: float = 0.0

    def __add__(self, other: "Work") -> "Work":  # type: ignore[override]  # of a tuple, + would join
        return Work(*(a + b for a, b in zip(self, other, strict=True)))

    def __sub__(self, other: "Work") -> "Work":
        return Work(*(max(a - b, 0.0) for a, b in zip(self, other, strict=True)))


NO_WORK = Work(0, 0, 0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Cost:
    """Cost of work.

    Attributes:
        each: processor seconds of one hit, one plane and one image.
        busy: processor seconds per second.
    """

    each: Work
    busy: float

    def seconds(self, work: Work) -> float:
        """Return the expected duration of some work."""
        return sum(a * b for a, b in zip(self.each, work, strict=True)) / self.busy


@dataclass(frozen=True, slots=True, kw_only=True)
class Expected:
    """Cost known before it is measured.

    Attributes:
        plane: processor time of composing a plane over the time of finding a hit at all of their light positions.
        image: processor seconds of writing an image.
        busy: processor seconds per second.
    """

    plane: float
    image: float
    busy: float


def pixel_cost(setup: FrameSetup, n_planes: int) -> float:
    """Return the approximate nanoseconds of composing a pixel of one of n planes."""
    eyes = 2 * setup.n_r + 1
    hits = eyes * float(setup.per_pixel.mean())
    weighing = AREA_PIXEL + AREA_HIT * hits if setup.area else 0.0
    return COMPOSING * (LOOK_UP * eyes / n_planes + ADD * hits + STORE) + weighing / n_planes


def hit_cost(setup: FrameSetup, n_lights: int) -> float:
    """Return the approximate nanoseconds of finding a hit, at that many light positions, that no other frame shares."""
    own = sum(feature.shadow_rays for feature in setup.features) / setup.lights.n_lights
    shadow_rays = n_lights * (1 + own)
    return EYE_RAY + OBSCURANCE_RAY * setup.indirect.settings.n_rays + SHADOW_RAY * shadow_rays


def eye_work(setup: FrameSetup, eye: int) -> float:
    """Return the native hits of an eye as `Work` counts them; those near the ends of the path are in fewer frames."""
    others = len(setup.frames_around(eye, 2 * setup.n_r if setup.balance else setup.n_r)) - 1
    each = 1.0 + VIEW * others / hit_cost(setup, setup.lights.n_lights)
    return each * float(setup.per_pixel[setup.frame_of(eye)]) * setup.n_zone


def block_work(setup: FrameSetup, wanted: Sequence[int], *, still: bool = False) -> Work:
    """Return the work of rendering the wanted cameras at the light positions of a setup.

    Args:
        still: the camera never moves: one frame is composed, and written for each camera.
    """
    frames = [0] if still else wanted
    hits = sum(eye_work(setup, eye) for eye in setup.eyes_for(frames))
    return Work(
        hits=hits,
        planes=len(frames) * setup.lights.n_lights * setup.share,
        images=len(wanted) * setup.lights.n_lights * setup.share,
        layers=len(wanted) * setup.has_layers * setup.share,
    )


class Clocks(NamedTuple):
    """Seconds on the clock, and processor seconds of the program."""

    wall: float
    cpu: float

    @classmethod
    def now(cls) -> "Clocks":
        return cls(time.perf_counter(), time.process_time())


class Pace:
    """Measures a render as it goes on, and estimates how long the rest will take. Any thread may call."""

    def __init__(
        self,
        work: Work,
        expected: Expected | None,
        clocks: Callable[[], Clocks] = Clocks.now,
        report: Callable[[float | None], object] | None = None,
    ) -> None:
        """Start to measure.

        Args:
            work: all of the render.
            expected: for a start; None: there is no estimate before all kinds of work were measured.
            report: receives what `left` returns after each step.
        """
        self._work, self._expected, self._clocks, self._report = work, expected, clocks, report
        self._lock = threading.Lock()
        self._last = self._seen = clocks()
        weight = EXPECTED_SECONDS if expected else 0.0
        self._recent = Clocks(weight, weight * expected.busy if expected else 0.0)
        self._done = self._spent = NO_WORK

    def lap(self, *, hits: float = 0.0, planes: float = 0.0) -> None:
        """The hits of an eye were found, or planes of a frame were composed, since the last call."""
        with self._lock:
            now, done = self._clocks(), Work(hits, planes, 0)
            self._done += done
            self._spent += Work(*(int(amount > 0) * (now.cpu - self._last.cpu) for amount in done))
            self._last = now
        self._tell()

    def written(self, images: float, seconds: float) -> None:
        """A file was written on another thread, of an image, a share of one, or (0) layers, in processor seconds."""
        with self._lock:
            self._done += Work(0, 0, images, not images)
            self._spent += Work(0, 0, seconds if images else 0.0, 0.0 if images else seconds)
            # not spent on what the main thread is at
            self._last = self._last._replace(cpu=self._last.cpu + seconds)
        self._tell()

    def _tell(self) -> None:
        if self._report:
            self._report(self.left())

    def cost(self) -> Cost | None:
        """Return the cost per unit so far; None: not known yet, because not even one eye was found."""
        with self._lock:
            now, done, spent = self._clocks(), self._done, self._spent
            wall, cpu = now.wall - self._seen.wall, now.cpu - self._seen.cpu
            fading = math.exp(-wall / MEMORY)
            self._recent = Clocks(fading * self._recent.wall + wall, fading * self._recent.cpu + cpu)
            self._seen, recent = now, self._recent
            if done.hits >= self._work.hits * NEARLY and done.planes >= self._work.planes:  # what is left is writing
                spent += Work(0, 0, max(now.cpu - self._last.cpu, 0.0))
        hit, plane, image, layers = (max(s, 0.0) / d if d > 0 else None for s, d in zip(spent, done, strict=True))
        known = self._expected
        if known and hit is not None:
            plane = known.plane * hit if plane is None else plane
            image = known.image if image is None else image
        if layers is None and image is not None:
            layers = LAYERS * image
        if hit is None or plane is None or image is None or layers is None or recent.cpu <= 0:
            return None
        return Cost(each=Work(hit, plane, image, layers), busy=recent.cpu / recent.wall)

    def left(self) -> float | None:
        """Return the expected seconds until the end; None: not known yet."""
        cost = self.cost()
        return None if cost is None else cost.seconds(self._work - self._done)
