"""Glossy scenes against Mitsuba's pictures of them: direct light, and all light with cells.

Direct light of both programs comes from native hits of one eye, without mirrors and without rays of lobes.
"""

from pathlib import Path
from typing import Any

import numpy as np

from bench.core.cases import with_resolution, with_tables
from bench.core.frames import frames, image_of
from bench.core.results import Table
from bench.lights import against as lit
from bench.truth import mitsuba
from bench.truth.compare import distance
from bench.truth.places import Place, job_of
from bench.truth.traced import Truth
from framearray_cli.base.forms.table import changed
from framearray_cli.job.job import Job, MaterialTable
from framearray_cli.render.prepare import Prepared
from framearray_cli.report.case import open_case
from framearray_cli.scene.files import read_meshes

PATHS = 512  # of all passes of all light
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
    return with_resolution(with_tables(job, tables), lit.QUICK_RESOLUTION if quick else lit.RESOLUTION)


def measure(scene: str, quick: bool) -> Table:
    """Compare a scene in a process of its own; {"skipped": why} where that is impossible."""
    return lit.measured_apart("gloss-against", scene, scene, quick)


def measure_here(scene: str, quick: bool, folder: Path) -> Table:
    """Compare a scene in this process, and keep the pictures."""
    mi, why = mitsuba.find_mitsuba()
    if why:
        return {"skipped": why}
    c, l = PLACES[scene]
    seeds = range(1, 1 + (lit.QUICK_PASSES if quick else lit.PASSES))
    with open_case(job_for(scene, quick, lit.NATIVE)) as case:
        prepared = case.prepared
        if why := mitsuba.unknown(prepared.scene):
            return {"skipped": why}
        ours = np.stack([composed.images[l] for composed in frames(case, c, seeds)])
    mi.set_variant(mitsuba.COMPILED)
    place = Place(job=scene, c=c, l=l)
    world = mitsuba.scene_of(mi, prepared, place, sky=False)
    sensor = mitsuba.sensor_of(mi, prepared, c)
    theirs = np.stack([mitsuba.direct_light(mi, world, sensor, prepared, lit.SAMPLES, seed) for seed in seeds])
    clear = lit.surfaces_only(mi, world, sensor, prepared)
    traced = mitsuba.pictures(mi, prepared, place, PATHS // (8 if quick else 1))
    halves = mitsuba.halves_of(traced.total)
    truth = Truth(total=halves, indirect=halves - mitsuba.halves_of(traced.light))
    image = image_of(job_for(scene, quick, {"indirect": {"method": "cells"}}), c, l)
    folder.mkdir(parents=True, exist_ok=True)
    np.savez(
        folder / f"gloss-{scene}.npz", ours=ours.mean(axis=0), theirs=theirs.mean(axis=0), image=image,
        truth=halves.mean(axis=0), clear=clear,
    )  # fmt: skip
    return {
        "direct": lit.compare(ours, theirs, clear),
        "all": distance(image, ours.mean(axis=0), truth),
        "glossy": _glossy_share(prepared),
        "hits": lit.HITS * len(seeds), "samples": lit.SAMPLES * len(seeds), "paths": PATHS,
        "resolution": list(prepared.job.camera.resolution), "version": mi.__version__,
    }  # fmt: skip


def _glossy_share(prepared: Prepared) -> float:
    """The share of triangles whose materials are glossy."""
    scene = prepared.scene
    return float((scene.roughness[scene.material] > 0).mean()) if len(scene.roughness) else 0.0
