"""Time per image against the size of a job, one size at a time; the rest is the frame array of the kitchen."""

import os
import time
from dataclasses import replace

import numpy as np

from bench.core.cases import FRAME_ARRAY, QUICK_RESOLUTION, Case, job_named, open_case, with_settings, with_tables
from bench.core.machine import busy, describe
from bench.core.results import Table
from bench.core.rooms import room
from bench.core.steady import steady
from framearray_cli.base.arrays import Float32, Float64
from framearray_cli.engine.inputs.lights import DIRECTIONAL, LightArrays, pad_lights
from framearray_cli.render.plan import plan_work
from framearray_cli.render.prepare import open_embree
from framearray_cli.report.settings import Settings
from framearray_cli.scene.paths.paths import Plane

from .speed import log

JOB = "kitchen"
LIGHTS = (1, 3, 6, 12, 24, 48, 96, 192)
N_R = (0, 1, 2, 3, 4, 6, 8, 12)
TRIANGLES = (1_000, 10_000, 100_000, 1_000_000)
PATHS = (1, 4, 16)  # factors on the length of the camera path
FRAMES = 2


def measure(quick: bool) -> Table:
    """All sweeps: name -> rows of sizes and costs."""
    shares = [busy()]
    found: Table = {"machine": describe(), "job": JOB, "resolution": list(QUICK_RESOLUTION if quick else (400, 300))}
    with open_case(job_named(JOB, quick)) as case:
        base = with_settings(case, FRAME_ARRAY.settings)
        for name, sweep in (("lights", _lights), ("n_r", _n_r), ("threads", _threads), ("cameras", _cameras)):
            found[name] = sweep(base, quick)
            shares.append(busy())
    found["triangles"] = _triangles(quick)
    shares.append(busy())
    found["busy"] = shares
    return found


def _row(case: Case, quick: bool, place: float = 0.5, **size: float) -> Table:
    measured = steady(case, 1 if quick else FRAMES, place=place)
    log(f"{size}: {measured.ms:.2f} ms per image, serial {measured.serial:.1%}")
    return {**size, **measured.table()}


def _lights(case: Case, quick: bool) -> list[Table]:
    return [_row(_with_lights(case, n), quick, lights=n) for n in LIGHTS]


def _with_lights(case: Case, n: int) -> Case:
    """The same path of the light at n positions."""
    lights, intensity = case.setup.lights, case.ambient.intensity
    at = np.linspace(0, lights.n_lights - 1, n) if n > 1 else np.array([(lights.n_lights - 1) / 2])
    return replace(
        case,
        setup=replace(case.setup, lights=resampled(lights, at), planes=(Plane.PICTURE,) * n),
        ambient=replace(
            case.ambient,
            intensity=np.ascontiguousarray(_between(intensity, at, 0)),
            standard_error=np.zeros(n),
        ),
    )


def resampled(lights: LightArrays, at: Float64) -> LightArrays:
    """The lights at places between their positions, (n,) from 0 to n_lights - 1."""
    vector = _between(lights.vector, at, 2)
    for s, kind in enumerate(lights.kind):
        if kind == DIRECTIONAL:
            vector[s] /= np.linalg.norm(vector[s], axis=0)
    found = lights._replace(
        vector=vector,
        strength=_between(lights.strength, at, 2),
        lit=np.ceil(_between(lights.lit, at, 1)),
        size=_between(lights.size, at, 1),
        cone=_between(lights.cone, at, 2),
        panel=_between(lights.panel, at, 2),
        colour=_between(lights.colour, at, 0),
        profiles=lights.profiles._replace(frame=_between(lights.profiles.frame, at, 2)),
    )
    return pad_lights(found)


def _between(values: Float32, at: Float64, axis: int) -> Float32:
    """Linear interpolation along an axis."""
    low = np.floor(at).astype(int)
    high = np.minimum(low + 1, values.shape[axis] - 1)
    shape = [1] * values.ndim
    shape[axis] = -1
    share = (at - low).reshape(shape)
    mixed = (1 - share) * values.take(low, axis) + share * values.take(high, axis)
    return np.asarray(mixed, np.float32)


def _n_r(case: Case, quick: bool) -> list[Table]:
    return [_row(with_settings(case, replace(FRAME_ARRAY.settings, n_r=n_r)), quick, n_r=n_r) for n_r in N_R]


def _threads(case: Case, quick: bool) -> list[Table]:
    cores = os.cpu_count() or 1
    counts = [n for n in (1, 2, 4, 8, 16, 32, 64, 128) if n < cores] + [cores]
    rows = []
    for n in counts:
        job = with_tables(case.prepared.job, {"render": {"threads": n}})
        rows.append(_row(replace(case, prepared=replace(case.prepared, job=job)), quick, threads=n))
    return rows


def _cameras(case: Case, quick: bool) -> list[Table]:
    """The camera path there and back again, several times over: the same steps, so the same reuse."""
    cams, per_pixel, eyes, rows = case.setup.cams, case.setup.per_pixel, case.prepared.eyes, []
    for times in PATHS:
        turn = np.concatenate([np.arange(len(per_pixel)), np.arange(len(per_pixel))[::-1]])
        at = np.tile(turn, times)[: times * len(per_pixel)]
        longer = cams._replace(
            position=cams.position[at], right=cams.right[at], up=cams.up[at], forward=cams.forward[at]
        )
        setup = replace(case.setup, cams=longer, per_pixel=per_pixel[at])
        seen = replace(eyes, position=eyes.position[at], world_from_camera=eyes.world_from_camera[at])
        longest = replace(case, setup=setup, prepared=replace(case.prepared, eyes=seen))
        # the same cameras every time: those of the middle of the first turn
        rows.append(_row(longest, quick, 0.5 / times, cameras=len(at)))
    return rows


def _triangles(quick: bool) -> list[Table]:
    rows = []
    for n in TRIANGLES[:3] if quick else TRIANGLES:
        prepared, scene_seconds = room(n, QUICK_RESOLUTION if quick else (400, 300))
        started = time.perf_counter()
        with open_embree(prepared) as embree:
            built = time.perf_counter() - started
            setup, ambient = plan_work(prepared, embree)
            settings = Settings.of(prepared.job)
            planned = Case(prepared=prepared, embree=embree, setup=setup, ambient=ambient, settings=settings)
            case = with_settings(planned, FRAME_ARRAY.settings)
            row = _row(case, quick, triangles=len(prepared.scene.corners))
        rows.append({**row, "scene_s": scene_seconds, "embree_s": built})
    return rows
