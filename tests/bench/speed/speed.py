"""Measures every variant of a job in turn, several times; each time at another place of the camera path."""

import sys
from collections.abc import Sequence
from dataclasses import replace

from bench.core.cases import VARIANTS, Case, Variant, job_named, open_case, parts_of
from bench.core.machine import describe, quiet
from bench.core.results import Table, limited, median
from bench.core.steady import start_of, steady_mean
from framearray_cli.array.images import ImageFormat

from .floor import replay
from .recording import record

# How images are written where a variant is timed with writing.
FORMATS = {
    "zip:1": ImageFormat(compression="zip:1", half="always"),
    "none": ImageFormat(compression="none", half="always"),
}
WRITTEN = "none"  # uncompressed: nothing but rendering and the disk
RUNS = 2


def places_of(runs: int) -> list[float]:
    """The place on the path, 0 to 1, of each run's cameras."""
    return [(r + 1) / (runs + 1) for r in range(runs)]


def measure(
    name: str, quick: bool, runs: int = RUNS, patience: float = 0.0, variants: Sequence[Variant] = VARIANTS
) -> Table:
    """Measure a job: variant -> medians of its runs; variants without `frames` are left out.

    With fewer instructions only those with a floor are measured.

    Args:
        patience: seconds to wait, before each measurement, for other programs to free the cores.
    """
    timed = [v for v in variants if v.frames and (v.floor or not limited())]
    found: dict[str, list[Table]] = {variant.name: [] for variant in timed}
    shares: list[float] = []
    with open_case(job_named(name, quick)) as case:
        for place in places_of(1 if quick else runs):
            for variant in timed:
                shares.append(quiet(patience))
                table = measure_once(case, replace(variant, frames=2) if quick else variant, place)
                found[variant.name].append(table)
                log(f"{name}: {variant.name}: {table['ms']:.2f} ms per image, others take {shares[-1]:.0%}")
        setup, job = case.setup, case.prepared.job
        about = {
            "triangles": len(setup.world.surfaces.corners),
            "resolution": list(job.camera.resolution),
            "n_lights": setup.lights.n_lights,
            "n_cameras": case.prepared.n_cameras,
            "mirrors": bool(setup.depth),
            "threads": case.prepared.threads,
        }
    return {
        "machine": describe(),
        "about": about,
        "busy": shares,
        "runs": found,
        "median": {variant: median(tables) for variant, tables in found.items()},
    }


def measure_once(case: Case, variant: Variant, place: float) -> Table:
    """Measure one variant at one place of the path, with its floor and with writing where it asks for them."""
    parts = parts_of(case, variant)
    table, *written = steady_mean(parts, variant.frames, [None, *(FORMATS[name] for name in variant.writes)], place)
    table["written"] = dict(zip(variant.writes, written, strict=True))
    if variant.floor:
        part = parts[len(parts) // 2]
        first = start_of(part, variant.frames, place)
        c = first + 2 * part.setup.n_r + 1 + variant.frames // 2
        expected = sum(table["rays"].values()) * part.setup.n_pixels * part.setup.lights.n_lights
        tape, threads = record(part, c, expected), part.prepared.threads
        table["floor"] = replay(tape, part.setup.world.tracer, threads, table["rays"])
        table["floor_ratio"] = {clock: table[clock] / sum(table["floor"][clock].values()) for clock in ("ms", "cpu_ms")}
    return table


def log(text: str) -> None:
    """Report a measurement at once."""
    print(text, file=sys.stderr, flush=True)
