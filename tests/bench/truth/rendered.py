"""The program's own images of a place: `framearray render` of one camera position, in a process of its own."""

import subprocess
import sys
from pathlib import Path

from bench.core.cases import open_case
from bench.core.results import ROOT
from bench.core.steady import steady
from bench.speed.processes import environment
from bench.speed.speed import FORMATS, WRITTEN
from framearray_cli.array.images import read_image
from framearray_cli.array.manifest import image_path
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.base.arrays import Image
from framearray_cli.base.forms.table import changed

from .places import Place, job_file, job_of

# How indirect light is computed, and the keys that ask for it.
METHODS = {
    "obscurance": ("indirect.method=obscurance",),
    "cells": ("indirect.method=cells",),
}
FRAMES, PLACE = 4, 0.4  # of the steady run that shows the time per image
DIRECT = ("ambient.intensity=[0.0, 0.0, 0.0]",)  # nothing but light of the sources


def render(place: Place, keys: tuple[str, ...], quick: bool, folder: Path) -> Image | str:
    """Render the images of a camera position; returns that of the light position, or the program's error."""
    output = folder / "truth-render"
    width, height = job_of(place.job, quick).camera.resolution
    settings = ("output.format=exr", f"camera.resolution=[{width}, {height}]", *keys)
    command = [sys.executable, "-m", "framearray_cli", "render", str(job_file(place.job))]
    command += ["--cameras", str(place.c), "-o", str(output), "--restart", "-q"]
    for setting in settings:
        command += ["--set", setting]
    done = subprocess.run(command, env=environment(), stderr=subprocess.PIPE, text=True, cwd=ROOT, check=False)
    if done.returncode:
        return done.stderr.strip().splitlines()[-1]
    found = read_manifest(output)
    return read_image(output / image_path(found, place.c, place.l))


def pace(name: str, method: str, quick: bool) -> float:
    """Milliseconds per image, written, among interior frames of a job that lights indirectly by a method."""
    job = job_of(name, quick)
    for setting in METHODS[method]:
        key, _, value = setting.partition("=")
        table, _, name = key.partition(".")
        job = changed(job, **{table: type(getattr(job, table)).model_validate({name: value})})
    with open_case(job) as case:
        frames = max(min(FRAMES, case.setup.n_frames - 2 * case.setup.n_r - 1), 1)
        return steady(case, frames, FORMATS[WRITTEN], PLACE).ms
