"""The time of rays by their kind, in packets of every width, with and without the flag of coherent rays.

The rays are those that the program traces for a frame of each job, and for its ambient light; only Embree's own calls
are timed, nanoseconds of thread time per ray. Widths and flags take turns, several times; figures are medians.
"""

import ctypes
import statistics
from dataclasses import replace

import numpy as np
from support.tables import Section, write_csv

from bench.core.cases import JOBS, Case, job_named, open_case
from bench.core.machine import describe
from bench.core.results import RESULTS, Table, load_some, site_for
from framearray_cli.base.arrays import Bytes, Float64
from framearray_cli.engine.embree.library import embree_library, embree_properties
from framearray_cli.engine.embree.packets import TFAR, Tracer

from .floor import seconds_in_embree
from .recording import COHERENT, Recording, record, record_ambient, regroup
from .speed import log

WIDTHS = (1, 4, 8, 16)
RUNS = 3
MOST_RAYS = 500_000  # of a kind


def measure(name: str, quick: bool) -> Table:
    """Nanoseconds of thread time per ray of a job: kind -> width -> [not coherent, coherent]."""
    kinds: Table = {}
    with open_case(job_named(name, quick)) as case:
        c = case.setup.n_frames // 2
        expected = 4 * case.setup.n_pixels * case.setup.lights.n_lights
        for recording in (record(case, c, expected), record_ambient(case)):
            kinds |= _nanoseconds(case, recording, 1 if quick else RUNS)
    for kind, found in kinds.items():
        log(f"{name}: {kind}: " + ", ".join(f"{w}: {a:.1f} / {b:.1f} ns" for w, (a, b) in found["ns"].items()))
    return {"machine": describe(), "native": list(embree_properties().packet_widths), "kinds": kinds}


def _nanoseconds(case: Case, recording: Recording, runs: int) -> Table:
    """Medians of several runs, by kind and width."""
    short = _first_rays(recording)
    variants = [(width, coherent) for width in WIDTHS for coherent in (False, True)]
    grouped = {width: regroup(short, width) for width in WIDTHS}
    spent: dict[tuple[int, bool], list[Float64]] = {variant: [] for variant in variants}
    for _ in range(runs + 1):  # the first run compiles
        for width, coherent in variants:
            flags = _flags(grouped[width], coherent)
            seconds = seconds_in_embree(replace(grouped[width], flags=flags), tracer_of(case, width), case.threads)
            spent[width, coherent].append(seconds[:, 1])
    found: Table = {}
    for i, kind in enumerate(short.kinds):
        n = short.n_rays[kind]
        if not n:
            continue
        ns = {
            str(width): [
                1e9 * statistics.median(run[i] for run in spent[width, flag][1:]) / n for flag in (False, True)
            ]
            for width in WIDTHS
        }
        start = next(start for start, _, of in short.pieces if of == i)
        found[kind] = {"rays": recording.n_rays[kind], "coherent": bool(short.flags[start] & COHERENT), "ns": ns}
    return found


def _flags(recording: Recording, coherent: bool) -> Bytes:
    """The flags of packets, all with or without COHERENT."""
    without = recording.flags & ~np.uint8(COHERENT)
    return without | np.uint8(COHERENT) if coherent else without


def _first_rays(recording: Recording) -> Recording:
    """At most MOST_RAYS of each kind: whole pieces, evenly spread."""
    kept, n_rays = [], {}
    for i, kind in enumerate(recording.kinds):
        pieces = recording.pieces[recording.pieces[:, 2] == i]
        step = -(-recording.n_rays[kind] // MOST_RAYS) or 1
        kept.append(pieces[::step])
        n_rays[kind] = sum(int((recording.rays[a:b, TFAR] >= 0).sum()) for a, b, _ in kept[-1])
    return replace(recording, pieces=np.concatenate(kept), n_rays=n_rays)


def tracer_of(case: Case, width: int) -> Tracer:
    """The case's tracer with Embree's functions for packets of a width."""
    library = embree_library()

    def address(name: str) -> int:
        return ctypes.cast(getattr(library, f"{name}{width}"), ctypes.c_void_p).value or 0

    return case.setup.world.tracer._replace(intersect=address("rtcIntersect"), occluded=address("rtcOccluded"))


SETS = {"": "", "avx2": ": AVX2"}


def write(quick: bool) -> None:
    """Write a table per job, with and without AVX-512: a row per kind of ray, a column per width."""
    sections = []
    for isa, words in SETS.items():
        results = RESULTS / isa / "quick" if quick else RESULTS / isa
        for name, table in load_some(results, {name: f"packets-{name}" for name in JOBS}).items():
            rows = [
                [kind, str(one["rays"]), *(" / ".join(f"{ns:.0f}" for ns in pair) for pair in one["ns"].values())]
                for kind, one in table["kinds"].items()
            ]
            head = ("", "rays", "single", *(f"{width} rays" for width in WIDTHS[1:]))
            sections.append(Section(name + words, head, rows))
    write_csv(site_for(quick).tables / "packets.csv", sections)
