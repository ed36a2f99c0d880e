"""The strength of the lights: render a few small pictures with and without them, and solve for the factor."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from framearray_cli.base.arrays import Float64, Images
from framearray_cli.base.colour import LUMINANCE, srgb_from_linear
from framearray_cli.engine.embree.embreescene import EmbreeScene
from framearray_cli.engine.frames.threads import TracePool
from framearray_cli.engine.images.window import Window
from framearray_cli.engine.loop import ready_frames
from framearray_cli.render.plan import plan_work
from framearray_cli.render.prepare import prepared_from
from framearray_cli.scene.paths.lightpath import LightPath
from framearray_cli.scene.paths.paths import eyes, lights, lights_without_groups
from framearray_cli.scene.scene import Scene

from .model import Start, table_of, validate_job

PICTURES = 3  # eyes and light positions that are rendered, at most
SIZE = (64, 48)  # pixels
WALKS = 4096  # for the ambient light, which is then known to some hundredths
CELL_SAMPLES = 2**15  # for cells that a few small pictures see
HITS = 8  # per pixel; the mean of three pictures is then known to a hundredth
CLIPPED = 0.03  # largest share of surface pixels that may clip
LEAST, MOST = 1e-12, 1e12  # bounds of the factor


@dataclass(frozen=True, slots=True, kw_only=True)
class Levels:
    """Target levels of pictures: means over surface pixels, sRGB encoded.

    Attributes:
        mean: with the lights.
        darkest: lowest mean; kept even if more pixels clip then.
        shade: highest mean without the lights; a sky that gives more is darkened.
    """

    mean: float
    darkest: float = 0.30
    shade: float


# A room is as bright as in the jobs that come with the project. For a thing under the sky, the sun must stand out.
ROOM, THING = Levels(mean=0.42, shade=0.28), Levels(mean=0.50, shade=0.18)


def find_factors(start: Start, scene: Scene, embree: EmbreeScene) -> tuple[float, float] | None:
    """Find the factors of all intensities and of the background; None where the lights light nothing that is seen."""
    lit, dark = _render_radiance(start, scene, embree)
    if not len(lit) or lit.mean() <= 0:
        return None
    levels = ROOM if start.inside else THING
    sky = min(1.0, _largest_factor(lambda factor: _mean_luminance(factor * dark) <= levels.shade))
    return solve_exposure(lit, sky * dark, levels), sky


def solve_exposure(lit: Float64, dark: Float64, levels: Levels) -> float:
    """Solve for the factor for which `factor * lit + dark` is well exposed.

    Args:
        lit: (n, 3) radiance of surfaces due to the lights.
        dark: (n, 3) the rest.
    """

    def clips(factor: float) -> bool:
        return float(((factor * lit + dark).max(axis=1) > 1).mean()) > CLIPPED

    right = _largest_factor(lambda factor: _mean_luminance(factor * lit + dark) <= levels.mean)
    if not clips(right):
        return right
    darkest = _largest_factor(lambda factor: _mean_luminance(factor * lit + dark) <= levels.darkest)
    return max(_largest_factor(lambda factor: not clips(factor)), darkest)


def _mean_luminance(radiance: Float64) -> float:
    return float((srgb_from_linear(radiance) @ LUMINANCE).mean())


def _largest_factor(holds: Callable[[float], bool]) -> float:
    """Find the largest factor for which a condition holds, by bisection; more light must break it."""
    low, high = np.log(LEAST), np.log(MOST)
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if holds(float(np.exp(middle))) else (low, middle)
    return float(np.exp(low))


def _render_radiance(start: Start, scene: Scene, embree: EmbreeScene) -> tuple[Float64, Float64]:
    """Render the radiance of all pixels that see a surface, (n, 3): that due to the lights, and the rest."""
    table = table_of(start)
    table["camera"]["resolution"] = list(SIZE)
    table |= {"samples": {"hits": HITS}, "reuse": {"n_r": 0}, "ambient": {"paths": WALKS}}
    if table["indirect"]["method"] == "cells":
        table["indirect"] |= {"samples": CELL_SAMPLES}
    job = validate_job(table, start.file)
    job_eyes, job_lights = eyes(job), lights(job)
    some = _spread_indices(job_eyes.n)
    few_eyes = job_eyes.at(some)
    few_lights = lights_without_groups(
        [_append_dark(source, _spread_indices(job_lights.n)) for source in job_lights.sources]
    )
    # several eyes are rendered even if they coincide: their mean has less noise
    prepared = replace(prepared_from(job, scene, few_eyes, few_lights), still=few_eyes.n == 1)
    setup, ambient = plan_work(prepared, embree, compare=False)
    shape = (setup.lights.n_lights, setup.cams.height, setup.cams.width, 3)
    found: list[Images] = []
    with TracePool(setup, prepared.threads) as pool:
        window = Window(setup, ambient, pool)
        for j in ready_frames(window, setup, range(setup.n_frames), pool):
            composed = window.compose(j, np.empty(shape, np.float32))
            found.append(composed.images[:, composed.layers["depth"] > 0])
    n = few_lights.n - 1
    images = np.concatenate(found, axis=1).astype(np.float64)  # (n + 1, pixels, 3); the last has no lights
    dark = np.repeat(images[-1:], n, axis=0)
    return np.maximum(images[:-1] - dark, 0).reshape(-1, 3), dark.reshape(-1, 3)


def _spread_indices(n: int) -> list[int]:
    """A few indices from the first to the last."""
    return sorted({round(float(k)) for k in np.linspace(0, n - 1, PICTURES)})


def _append_dark(source: LightPath, some: list[int]) -> LightPath:
    """Some positions of a source, followed by one at which it does not shine."""
    shown = source.at([*some, 0])
    around = shown.environment and replace(shown.environment, factor=_with_dark(shown.environment.factor))
    return replace(shown, intensity=_with_dark(shown.intensity), environment=around, notes=())


def _with_dark(strength: Float64) -> Float64:
    """Strengths (n, 3) of which the last is 0."""
    return np.concatenate([strength[:-1], np.zeros((1, 3))])
