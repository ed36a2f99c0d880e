"""Direct light of sources of every kind against Mitsuba's, in real scenes: `python -m bench lights against`.

Eyes see no lamps. Blocks of pixels through which an eye sees a surface that shines, or out of the scene, are left out.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from support.scenes import scenes_folder

from bench.core.cases import with_resolution
from bench.core.frames import frames
from bench.core.results import Table
from bench.speed.processes import asked_of_mitsuba
from bench.speed.speed import log
from bench.truth import mitsuba
from bench.truth.compare import means
from bench.truth.emitters import hidden_sides, past_lamps
from bench.truth.places import Place as Seen
from bench.truth.places import job_of
from framearray_cli.base.arrays import Flags, Float32, Float64
from framearray_cli.job.job import Job
from framearray_cli.render.prepare import Prepared
from framearray_cli.report.case import open_case

from .sources import DIRECT, DOWN, Source, job_with, sky, write_map

RESOLUTION, QUICK_RESOLUTION = (160, 120), (32, 24)
PASSES, QUICK_PASSES = 8, 2  # independent ones of both programs, at least
HITS, SAMPLES = 16, 64  # of one pass
# Native hits of one eye, nothing but direct light, no mirrors.
NATIVE: dict[str, Any] = {
    **DIRECT,
    "samples": {"obscurance": 1, "hits": HITS},
    "reuse": {"n_r": 0, "weights": "average"},
    "specular": {"depth": 0},
}
# Times as many passes, where light is noisier.
MORE = {"mesh": 32, "environment": 4, "spot": 2}
KINDS = ("rect", "disc", "sphere", "spot", "mesh", "environment")


@dataclass(frozen=True, kw_only=True)
class Place:
    """Where sources are put in a scene, scene units.

    Attributes:
        c: camera position.
        lamp: of a sphere, a disc and a spot, which shine at `target` where they have an axis.
        panel: of a rectangle that faces down.
        size: of the rectangle; a quarter of it is the radius of disc and sphere.
        power: W of all.
        mesh: material that shines, and its radiance.
        origin: of Mitsuba's coordinates for the mesh, whose light is found nearest to it; see `scene_of`.
        rotation: of the sky, degrees, so that its sun comes in.
    """

    c: int
    lamp: tuple[float, float, float]
    target: tuple[float, float, float]
    panel: tuple[float, float, float]
    size: float
    power: float
    mesh: tuple[str, float]
    origin: tuple[float, float, float]
    rotation: float


SCENES = {
    "country_kitchen": Place(
        c=5, lamp=(-0.5, 2.3, -0.5), target=(0.1, 0.86, -1.5), panel=(0.1, 2.05, -0.6), size=0.8, power=80.0,
        mesh=("Bulb", 400.0), origin=(0.18, 2.44, -1.63), rotation=25.0,
    ),
    "modern_hall": Place(
        c=3, lamp=(2.0, 4.0, 1.0), target=(0.0, 1.0, -1.5), panel=(0.5, 3.5, 0.5), size=1.2, power=300.0,
        mesh=("Wallpaper", 6.0), origin=(-7.9, 1.5, -3.0), rotation=-160.0,
    ),
}  # fmt: skip
PARTS = {f"against-{scene}-{kind}": (scene, kind) for scene in SCENES for kind in KINDS}


def source_of(kind: str, place: Place, folder: Path) -> Source:
    """A source as in a job file, at one light position."""
    radius, aimed = place.size / 4, {"frame": 0, "position": place.lamp, "target": place.target}
    intensity = [place.power / 4 / np.pi] * 3
    if kind == "rect":
        size = {"width": place.size, "height": 0.6 * place.size}
        key = {"frame": 0, "position": place.panel, "direction": DOWN, "power": [place.power] * 3, **size}
        return {"type": "rect", "keys": [key]}
    if kind == "disc":
        return {"type": "disc", "keys": [{**aimed, "power": [place.power] * 3, "radius": radius}]}
    if kind == "sphere":
        key = {"frame": 0, "position": place.lamp, "intensity": intensity, "radius": radius}
        return {"type": "point", "keys": [key]}
    if kind == "spot":
        return {"type": "spot", "keys": [{**aimed, "intensity": intensity, "inner": 25.0, "outer": 25.0}]}
    if kind == "mesh":
        material, radiance = place.mesh
        keys = [{"frame": 0, "radiance": [radiance] * 3}]
        return {"type": "mesh", "material": material, "two_sided": False, "keys": keys}
    file = write_map(folder / "around.exr", sky(with_sun=True))
    return {"type": "environment", "file": file, "keys": [{"frame": 0, "rotation": place.rotation}]}


def job_for(part: str, quick: bool, folder: Path) -> Job:
    """The job of a part: one source, and its direct light only."""
    scene, kind = PARTS[part]
    job = job_with(job_of(f"{scene}-lamp", False), [source_of(kind, SCENES[scene], folder)], NATIVE, frames=1)
    return with_resolution(job, QUICK_RESOLUTION if quick else RESOLUTION)


def measure(part: str, quick: bool, folder: Path) -> Table:
    """Compare a part in a process of its own; {"skipped": why} where that is impossible."""
    return measured_apart("lights-against", part, PARTS[part][0], quick)


def measured_apart(command: str, part: str, scene: str, quick: bool) -> Table:
    """What a command of the bench finds of a part in a process of its own, in which Mitsuba may end badly."""
    if not (scenes_folder() / scene / "camera.json").is_file():
        return {"skipped": "no such scene; set FRAMEARRAY_SCENES to the folder of scenes"}
    table = asked_of_mitsuba(command, part, quick=quick)
    log(f"{part}: {table}")
    return table


def measure_here(part: str, quick: bool, folder: Path) -> Table:
    """Compare a part in this process, and keep its pictures."""
    mi, why = mitsuba.find_mitsuba()
    if why:
        return {"skipped": why}
    scene, kind = PARTS[part]
    place, seeds = SCENES[scene], range(1, 1 + (QUICK_PASSES if quick else PASSES * MORE.get(kind, 1)))
    with open_case(job_for(part, quick, folder / "lights")) as case:
        if why := mitsuba.unknown(case.prepared.scene):
            return {"skipped": why}
        prepared = case.prepared
        ours = np.stack([composed.images[0] for composed in frames(case, place.c, seeds)])
    mi.set_variant(mitsuba.COMPILED)
    # at what shines, or in the middle of what is lit: rays start higher above surfaces that are far from the origin
    origins = {"mesh": np.array(place.origin), "environment": np.array(place.target)}
    origin = origins.get(kind, prepared.eyes.position[place.c])
    seen = Seen(job=part, c=place.c, l=0)
    world = mitsuba.scene_of(mi, prepared, seen, sky=False, origin=origin)
    sensor = mitsuba.sensor_of(mi, prepared, place.c, origin)
    theirs = np.stack([mitsuba.direct_light(mi, world, sensor, prepared, SAMPLES, seed) for seed in seeds])
    clear = surfaces_only(mi, world, sensor, prepared)
    np.savez(folder / f"lights-{part}.npz", ours=ours.mean(axis=0), theirs=theirs.mean(axis=0), clear=clear)
    return {
        **compare(ours, theirs, clear), "hits": HITS * len(seeds), "samples": SAMPLES * len(seeds),
        "passes": len(seeds),
        "resolution": list(prepared.job.camera.resolution), "version": mi.__version__,
    }  # fmt: skip


def surfaces_only(mi: Any, scene: Any, sensor: Any, prepared: Prepared) -> Flags:
    """(h, w) pixels through which an eye sees nothing but surfaces that do not shine."""
    import drjit as dr

    width, height = prepared.job.camera.resolution
    ray, _ = mitsuba.eye_rays(mi, sensor, (width, height), SAMPLES, 1_000_001)
    hit = past_lamps(scene, ray, mi.Bool(True), hidden_sides(prepared))
    plain = hit.is_valid() & (hit.emitter(scene) == None)  # noqa: E711  # drjit compares arrays by ==
    counts = dr.block_reduce(dr.ReduceOp.Add, dr.select(plain, mi.UInt32(1), mi.UInt32(0)), SAMPLES)
    return np.asarray(np.array(counts).reshape(height, width) == SAMPLES)


def compare(ours: Float32, theirs: Float32, clear: Flags) -> Table:
    """Differences of means over BLOCK x BLOCK pixels from independent passes, (n, h, w, 3) each.

    Returns:
        mean: (ours - theirs) / theirs of all clear blocks together, and `error`, its standard error; chi: RMS
        difference of blocks over what the spread of the passes explains; rms: the former, over the mean;
        share: of blocks that are clear.
    """
    chosen = _blocks(clear[None, ..., None].astype(np.float64))[0, ..., 0] == 1
    a, b = (_blocks(passes)[:, chosen] for passes in (ours, theirs))
    level = float(b.mean())
    noise = sum(mitsuba.error_of_mean(passes) ** 2 for passes in (a, b))
    explained = sum(float(passes.var(axis=0, ddof=1).mean()) / len(passes) for passes in (a, b))
    difference = float(((a.mean(axis=0) - b.mean(axis=0)) ** 2).mean()) ** 0.5
    return {
        "mean": float(a.mean()) / level - 1,
        "error": noise**0.5 / level,
        "chi": difference / explained**0.5,
        "rms": difference / level,
        "share": float(chosen.mean()),
    }


def _blocks(passes: Any) -> Float64:
    """Means over BLOCK x BLOCK pixels, (n, h / BLOCK, w / BLOCK, channels)."""
    return np.stack([means(image) for image in passes])
