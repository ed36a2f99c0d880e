"""Glossy scenes against Mitsuba's pictures of them: direct light, and all light with cells.

Direct light of both programs comes from native hits of one eye, without mirrors and without rays of lobes.
"""

from pathlib import Path
from typing import Any

import numpy as np

from bench.core.cases import with_resolution, with_tables
from bench.core.frames import frames
from bench.core.results import Table
from bench.lights.against import compare, measured_apart, surfaces_only
from bench.lights.sources import DIRECT
from bench.truth import mitsuba
from bench.truth.compare import distance
from bench.truth.places import Place, job_of
from bench.truth.traced import Truth
from framearray_cli.base.arrays import Float32
from framearray_cli.base.forms.table import changed
from framearray_cli.job.job import Job, MaterialTable
from framearray_cli.render.prepare import Prepared
from framearray_cli.report.case import open_case
from framearray_cli.scene.files import read_meshes

RESOLUTION, QUICK_RESOLUTION = (160, 120), (32, 24)
PASSES, QUICK_PASSES = 8, 2  # independent ones of both programs
HITS, SAMPLES, PATHS = 16, 64, 512  # of one pass; paths of all passes of all light
# Scenes, each with a camera position and a light position.
PLACES = {"country_kitchen": (5, 3), "modern_hall": (3, 2), "vr_gallery": (4, 2)}


def job_for(scene: str, quick: bool, tables: dict[str, dict[str, Any]]) -> Job:
    """The job of a scene under a lamp; surfaces are as its file has them, but glass is opaque and nothing shines."""
    job = job_of(f"{scene}-lamp", False)
    materials = read_meshes(job.scene.file, as_file=True).materials
    plain = {
        m.name: MaterialTable(
            transmission=0.0 if m.glass else None, emission=(0.0, 0.0, 0.0) if any(m.emission) else None
        )
        for m in materials
        if m.glass or any(m.emission)
    }
    job = changed(job, scene=changed(job.scene, surfaces="file", materials=plain))
    return with_resolution(with_tables(job, tables), QUICK_RESOLUTION if quick else RESOLUTION)


def measure(scene: str, quick: bool) -> Table:
    """Compare a scene in a process of its own; {"skipped": why} where that is impossible."""
    return measured_apart("gloss-against", scene, scene, quick)


def measure_here(scene: str, quick: bool, folder: Path) -> Table:
    """Compare a scene in this process, and keep the pictures."""
    mi, why = mitsuba.find_mitsuba()
    if why:
        return {"skipped": why}
    c, l = PLACES[scene]
    native = {"samples": {"hits": HITS, "obscurance": 1}, "reuse": {"n_r": 0, "weights": "average"}}
    dark = {**DIRECT, **native, "specular": {"depth": 0}}
    seeds = range(1, 1 + (QUICK_PASSES if quick else PASSES))
    with open_case(job_for(scene, quick, dark)) as case:
        prepared = case.prepared
        if why := mitsuba.unknown(prepared.scene):
            return {"skipped": why}
        ours = np.stack([composed.images[l] for composed in frames(case, c, seeds)])
    mi.set_variant(mitsuba.COMPILED)
    place = Place(job=scene, c=c, l=l)
    world = mitsuba.scene_of(mi, prepared, place, sky=False)
    sensor = mitsuba.sensor_of(mi, prepared, c)
    theirs = np.stack([mitsuba.direct_light(mi, world, sensor, prepared, SAMPLES, seed) for seed in seeds])
    clear = surfaces_only(mi, world, sensor, prepared)
    traced = mitsuba.pictures(mi, prepared, place, PATHS // (8 if quick else 1))
    halves = traced.total.reshape(2, -1, *traced.total.shape[1:]).mean(axis=1)
    light = traced.light.reshape(2, -1, *traced.light.shape[1:]).mean(axis=1)
    truth = Truth(total=halves, indirect=halves - light)
    image = _all_light(job_for(scene, quick, {"indirect": {"method": "cells"}}), c, l)
    folder.mkdir(parents=True, exist_ok=True)
    np.savez(
        folder / f"gloss-{scene}.npz", ours=ours.mean(axis=0), theirs=theirs.mean(axis=0), image=image,
        truth=halves.mean(axis=0), clear=clear,
    )  # fmt: skip
    return {
        "direct": compare(ours, theirs, clear),
        "all": distance(image, ours.mean(axis=0), truth),
        "glossy": _glossy_share(prepared),
        "hits": HITS * len(seeds), "samples": SAMPLES * len(seeds), "paths": PATHS,
        "resolution": list(prepared.job.camera.resolution), "version": mi.__version__,
    }  # fmt: skip


def _all_light(job: Job, c: int, l: int) -> Float32:
    """The image of a job with reuse, as it would be rendered."""
    with open_case(job) as case:
        (composed,) = frames(case, c, [job.seed])
    image: Float32 = composed.images[l]
    return image


def _glossy_share(prepared: Prepared) -> float:
    """The share of triangles whose materials are glossy."""
    scene = prepared.scene
    return float((scene.roughness[scene.material] > 0).mean()) if len(scene.roughness) else 0.0
