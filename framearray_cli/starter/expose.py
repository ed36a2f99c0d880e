"""How strong the lights must be: a few small pictures with and without them, and the factor that makes them right."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from framearray_cli.base.arrays import Float64, Images
from framearray_cli.base.colour import srgb_from_linear
from framearray_cli.engine.embree import EmbreeScene
from framearray_cli.engine.frames.threads import TracePool
from framearray_cli.engine.images.window import Window
from framearray_cli.engine.loop import ready_frames
from framearray_cli.render.prepare import plan_work, prepared_from
from framearray_cli.scene.paths.paths import LightPath, eyes, lights, lights_without_groups
from framearray_cli.scene.scene import Scene

from .model import Start, checked, table_of

PICTURES = 3  # eyes, and light positions, that are tried
SIZE = (64, 48)  # pixels
WALKS = 4096  # of the ambient light; it is known to some hundredths
HITS = 8  # of a pixel; the mean of three pictures is then known to a hundredth
CLIPPED = 0.03  # largest share of surface pixels that are clipped
LEAST, MOST = 1e-12, 1e12  # factors that are looked between
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # of Rec. 709


@dataclass(frozen=True, slots=True, kw_only=True)
class Levels:
    """What pictures are to be: means of their surfaces, sRGB encoded.

    Attributes:
        mean: wanted.
        darkest: kept even if more pixels clip then.
        shade: without the lights, at most; the sky is darkened where it alone gives more.
    """

    mean: float
    darkest: float = 0.30
    shade: float


# A room is as bright as those of the jobs that come with the project. A thing under the sky needs the sun to stand out.
ROOM, THING = Levels(mean=0.42, shade=0.28), Levels(mean=0.50, shade=0.18)


def factors_for(start: Start, scene: Scene, embree: EmbreeScene) -> tuple[float, float] | None:
    """Find what all intensities, and the background, are to be multiplied with.

    None where the lights light nothing that is seen.
    """
    lit, dark = _pictures(start, scene, embree)
    if not len(lit) or lit.mean() <= 0:
        return None
    levels = ROOM if start.inside else THING
    sky = min(1.0, _largest(lambda factor: _mean(factor * dark) <= levels.shade))
    return solved(lit, sky * dark, levels), sky


def solved(lit: Float64, dark: Float64, levels: Levels) -> float:
    """The factor for which `factor * lit + dark` is well exposed.

    Args:
        lit: (n, 3) radiance of surfaces that comes from the lights.
        dark: (n, 3) the rest.
    """

    def clips(factor: float) -> bool:
        return float(((factor * lit + dark).max(axis=1) > 1).mean()) > CLIPPED

    right = _largest(lambda factor: _mean(factor * lit + dark) <= levels.mean)
    if not clips(right):
        return right
    darkest = _largest(lambda factor: _mean(factor * lit + dark) <= levels.darkest)
    return max(_largest(lambda factor: not clips(factor)), darkest)


def _mean(radiance: Float64) -> float:
    return float((srgb_from_linear(radiance) @ LUMINANCE).mean())


def _largest(holds: Callable[[float], bool]) -> float:
    """The largest factor for which a condition holds that more light breaks."""
    low, high = np.log(LEAST), np.log(MOST)
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if holds(float(np.exp(middle))) else (low, middle)
    return float(np.exp(low))


def _pictures(start: Start, scene: Scene, embree: EmbreeScene) -> tuple[Float64, Float64]:
    """Radiance of all pixels that see a surface, (n, 3): what the lights add, and what is there without them."""
    table = table_of(start)
    table["camera"]["resolution"] = list(SIZE)
    table |= {"samples": {"hits": HITS}, "reuse": {"n_r": 0}, "ambient": {"paths": WALKS}}
    job = checked(table, start.file)
    job_eyes, job_lights = eyes(job), lights(job)
    some = _spread(job_eyes.n)
    few_eyes = replace(job_eyes, position=job_eyes.position[some], world_from_camera=job_eyes.world_from_camera[some])
    few_lights = lights_without_groups([_and_none(source, _spread(job_lights.n)) for source in job_lights.sources])
    # several eyes are rendered even where they are one place: their mean has less noise
    prepared = replace(prepared_from(job, scene, few_eyes, few_lights), still=few_eyes.n == 1)
    setup, ambient = plan_work(prepared, embree)
    shape = (setup.lights.n_lights, setup.cams.height, setup.cams.width, 3)
    found: list[Images] = []
    with TracePool(setup, prepared.threads) as pool:
        window = Window(setup, ambient, pool)
        for j in ready_frames(window, setup, range(setup.n_frames), pool):
            composed = window.compose(j, np.empty(shape, np.float32))
            assert composed.layers is not None
            found.append(composed.images[:, composed.layers.depth > 0])
    n = few_lights.n - 1
    images = np.concatenate(found, axis=1).astype(np.float64)  # (n + 1, pixels, 3); the last has no lights
    dark = np.repeat(images[-1:], n, axis=0)
    return np.maximum(images[:-1] - dark, 0).reshape(-1, 3), dark.reshape(-1, 3)


def _spread(n: int) -> list[int]:
    """A few indices from the first to the last."""
    return sorted({round(float(k)) for k in np.linspace(0, n - 1, PICTURES)})


def _and_none(source: LightPath, some: list[int]) -> LightPath:
    """Some positions of a source, and then one at which it does not shine."""
    vector = np.concatenate([source.vector[some], source.vector[:1]])
    intensity = np.concatenate([source.intensity[some], np.zeros((1, 3))])
    return replace(source, vector=vector, intensity=intensity, notes=())
