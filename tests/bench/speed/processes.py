"""Start-up time, peak memory and cost by size, each measured in a process of its own."""

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import tomli_w

from bench.core.cases import JOBS, job_named
from bench.core.machine import busy
from bench.core.results import ROOT, Table
from framearray_cli.job.read import job_table

from .speed import log

REPEATS = 3
SIZES = ((400, 300), (1280, 720), (1920, 1080))
PROGRAM = (sys.executable, "-m", "framearray_cli")
# Traces one ray, then does everything before the first frame, and reports the end of each.
FIRST_RAYS = """
import sys
from pathlib import Path
from framearray_cli.job.read import read_job
from framearray_cli.render.plan import plan_work
from framearray_cli.render.prepare import open_embree, prepare
prepared = prepare(read_job(Path(sys.argv[1])))
with open_embree(prepared) as embree:
    from framearray_cli.engine.embree.packets import HIT_ROWS, empty_packets, intersect
    intersect(embree.tracer, empty_packets(1, HIT_ROWS), 1, True, 0.0)
    print("ray", flush=True)
    plan_work(prepared, embree)
    print("plan", flush=True)
"""


def environment(**changes: str) -> dict[str, str]:
    """The environment of a process that runs the program of this checkout as a user would."""
    kept = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    places = [str(ROOT), str(ROOT / "tests"), *filter(None, [kept.get("PYTHONPATH")])]
    return {**kept, "PYTHONPATH": os.pathsep.join(places), **changes}


def start_up(quick: bool) -> Table:
    """Seconds until help is shown, a ray is traced, and a tiny job is done; with and without compiled kernels."""
    repeats = 1 if quick else REPEATS
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        job = folder / "smoke.toml"
        table = job_table(job_named("smoke", False))
        table["output"]["directory"] = str(folder / "out")
        job.write_text(tomli_w.dumps(table), encoding="utf-8")
        cache = environment(NUMBA_CACHE_DIR=str(folder / "kernels"))
        first_rays = (sys.executable, "-c", FIRST_RAYS, str(job))
        render = (*PROGRAM, "render", str(job))
        seconds_of((*PROGRAM, "--help"), cache)  # so that bytecode and files are where they are on a machine in use
        found: Table = {
            "busy": busy(),
            "help": statistics.median([seconds_of((*PROGRAM, "--help"), cache) for _ in range(repeats)]),
        }
        found["cold"] = _marks(first_rays, cache)
        warm = [_marks(first_rays, cache) for _ in range(repeats)]
        found["warm"] = {mark: statistics.median([run[mark] for run in warm]) for mark in warm[0]}
        fresh = environment(NUMBA_CACHE_DIR=str(folder / "fresh"))
        found["cold"]["job"] = seconds_of(render, fresh)
        log(f"start-up: cold {found['cold']['job']:.1f} s in all")
        found["warm"]["job"] = statistics.median([seconds_of((*render, "--restart"), fresh) for _ in range(repeats)])
    warmed = found["warm"]
    log(f"start-up: help {found['help']:.2f} s, first ray {warmed['ray']:.2f} s, job {warmed['job']:.2f} s")
    return found


def seconds_of(command: Sequence[str], env: Mapping[str, str], folder: Path | None = None) -> float:
    """Seconds that a command takes."""
    started = time.perf_counter()
    subprocess.run(command, cwd=folder, env=env, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    return time.perf_counter() - started


def _marks(command: Sequence[str], env: Mapping[str, str]) -> dict[str, float]:
    """Seconds from the start until each line that the command prints."""
    found: dict[str, float] = {}
    started = time.perf_counter()
    with subprocess.Popen(command, env=env, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for line in process.stdout:
            found[line.strip()] = time.perf_counter() - started
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, command)
    return found


def asked(*arguments: str) -> Table:
    """Run `python -m bench` with some arguments in a process of its own; returns the JSON that it prints."""
    command = (sys.executable, "-m", "bench", *arguments)
    done = subprocess.run(command, env=environment(), check=True, stdout=subprocess.PIPE, text=True, cwd=ROOT)
    table: Table = json.loads(done.stdout.splitlines()[-1])
    return table


def asked_of_mitsuba(*arguments: str, quick: bool) -> Table:
    """The same; {"skipped": why} where something does not fit, and Mitsuba ends the process."""
    try:
        return asked(*arguments, *(["--quick"] if quick else []))
    except subprocess.CalledProcessError as error:
        return {"skipped": f"Mitsuba ended with status {error.returncode}"}


def memory(quick: bool, jobs: Sequence[str] = JOBS) -> Table:
    """Peak memory of the steady state, bytes, by job and variant."""
    found: Table = {}
    for name in jobs:
        found[name] = {}
        for variant in ("frame array", "weights area"):
            found[name][variant] = asked("peak", name, "--variant", variant, *(["--quick"] if quick else []))
            log(f"{name}: {variant}: {found[name][variant]['peak'] / 2**30:.2f} GiB at most")
    return found


def sizes(quick: bool, jobs: Sequence[str] = JOBS) -> Table:
    """Cost of an image and peak memory of the steady state, by job and size of pictures."""
    found: Table = {}
    for name in jobs:
        found[name] = []
        for width, height in SIZES[:1] if quick else SIZES:
            row = asked("peak", name, "--variant", "weights area", "--resolution", f"{width}x{height}", "--frames", "1")
            row |= {"width": width, "height": height, "ms_megapixel": row["ms"] / (width * height / 1e6)}
            found[name].append(row)
            cost = f"{row['ms']:.2f} ms per image, {row['ms_megapixel']:.1f} ms per image and megapixel"
            log(f"{name}, {width} x {height}: {cost}, {row['peak'] / 2**30:.2f} GiB at most")
    return found
