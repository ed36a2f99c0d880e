"""The program's own images of a place: `framearray render` of one camera position, in a process of its own."""

import subprocess
import sys
from pathlib import Path

from bench.core.cases import job_named
from bench.core.results import ROOT
from bench.speed.processes import environment
from framearray_cli.array.images.images import read_image
from framearray_cli.array.manifest import image_path
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.base.arrays import Image

from .traced import Place

# How indirect light is computed, and the keys that ask for it.
METHODS = {
    "obscurance": ("ambient.method=eye",),
    "obscurance, fit": ("ambient.method=fit",),
    "cells": ("indirect.method=cells",),
}
DIRECT = ("ambient.intensity=[0.0, 0.0, 0.0]",)  # nothing but light of the sources


def render(place: Place, keys: tuple[str, ...], quick: bool, folder: Path) -> Image | str:
    """Render the images of a camera position; returns that of the light position, or the program's error."""
    output = folder / "truth-render"
    width, height = job_named(place.job, quick).camera.resolution
    settings = ("output.format=exr", f"camera.resolution=[{width}, {height}]", *keys)
    command = [sys.executable, "-m", "framearray_cli", "render", str(ROOT / "jobs" / f"{place.job}.toml")]
    command += ["--cameras", str(place.c), "-o", str(output), "--restart", "-q"]
    for setting in settings:
        command += ["--set", setting]
    done = subprocess.run(command, env=environment(), stderr=subprocess.PIPE, text=True, cwd=ROOT, check=False)
    if done.returncode:
        return done.stderr.strip().splitlines()[-1]
    found = read_manifest(output)
    return read_image(output / image_path(found, place.c, place.l))
