"""The command: `python -m bench`, from the folder `tests`."""

import argparse
import json
import os
import sys
from collections.abc import Callable
from typing import Any

from bench.core.cases import FRAME_ARRAY, JOBS, job_named, open_case, variant_named, with_resolution, with_settings
from bench.core.results import folder, limited, load_some, save
from bench.core.steady import steady
from bench.error import reported, reports
from bench.gloss import against as glossy
from bench.gloss import run as gloss
from bench.lights import against
from bench.lights import run as lights
from bench.peers import mitsuba3
from bench.speed import first, processes, scaling, speed, tables
from bench.truth import flicker
from bench.truth import run as truth
from bench.truth.places import Place
from bench.truth.rendered import METHODS, pace
from bench.truth.traced import trace_here
from bench.view import attack, live
from bench.view import page as viewpage

# As `make test-avx2` limits the tests.
AVX2 = {"FRAMEARRAY_EMBREE": "isa=avx2", "NUMBA_CPU_NAME": "x86-64-v3"}


def peak(args: argparse.Namespace) -> dict[str, object]:
    """Run a variant for a moment; returns its cost, and the peak memory of this process."""
    from framearray_cli.base.platform import largest_size

    job = job_named(args.jobs[0], args.quick)
    if args.resolution:
        width, height = map(int, args.resolution.split("x"))
        job = with_resolution(job, (width, height))
    with open_case(job) as case:
        before = largest_size()
        measured = steady(with_settings(case, variant_named(args.variant).settings), args.frames)
        return {**measured.table(), "peak": largest_size(), "before": before}


def trace_place(args: argparse.Namespace) -> dict[str, object]:
    """Trace an image of a job: its name, camera and light position."""
    job, c, l = args.jobs
    return trace_here(Place(job=job, c=int(c), l=int(l)), args.quick, folder(args.quick))


# Measurements by their name, of some parts or jobs, that write their tables themselves or print.
ALONE: dict[str, Callable[[argparse.Namespace], None]] = {
    "truth": lambda args: truth.run(args.jobs, args.quick, args.method),
    "flicker": lambda args: flicker.run(args.jobs, args.quick),
    "lights": lambda args: lights.run(args.jobs, args.quick),
    "gloss": lambda args: gloss.run(args.jobs, args.quick),
    "view": lambda args: viewpage.run(args.jobs, args.patience, args.quick, args.cameras),
    "live": lambda args: live.run(args.jobs),
    "attack": lambda args: attack.run(),
}
# Parts of measurements in a process of their own, which print their result as JSON.
APART: dict[str, Callable[[argparse.Namespace], Any]] = {
    "lights-against": lambda args: against.measure_here(args.jobs[0], args.quick, folder(args.quick)),
    "gloss-against": lambda args: glossy.measure_here(args.jobs[0], args.quick, folder(args.quick)),
    "trace-place": trace_place,
    "pace": lambda args: {"ms": pace(args.jobs[0], args.method[0], args.quick)},
    "first": lambda args: first.run(args.jobs),
    "peak": peak,
    "mitsuba-here": lambda args: mitsuba3.measure_here(args.jobs[0], args.quick),
}
# Measurements of jobs by their name, whose results are kept.
KEPT: dict[str, Callable[[str, argparse.Namespace], dict[str, Any]]] = {
    "speed": lambda name, args: speed.measure(name, args.quick, args.runs, args.patience),
    "mitsuba": lambda name, args: mitsuba3.measure(name, args.quick),
    "reported": lambda name, args: {"rows": reported.measure(name, folder(args.quick))},
}
PARTS = ("speed", "mitsuba", "memory", "sizes", "startup")


def main() -> None:
    """Measure the parts asked for, and write the tables."""
    parser = argparse.ArgumentParser(prog="bench", description="Measure, and write the tables of docs/quality/.")
    names = ("all", *ALONE, *APART, *KEPT, *PARTS, "scaling", "report", "page")
    parser.add_argument("what", nargs="?", default="all", choices=tuple(dict.fromkeys(names)))
    parser.add_argument("jobs", nargs="*", help="some of the jobs, parts of `lights`, or arrays for `view`")
    parser.add_argument("--quick", action="store_true", help="a small picture, once; tables go to out/bench/quick")
    parser.add_argument("--runs", type=int, default=speed.RUNS, help="how often each thing is measured")
    parser.add_argument("--patience", type=float, default=0.0, help="seconds to wait for a busy machine, each time")
    parser.add_argument("--method", nargs="*", default=[], choices=[*METHODS], help="for `truth` and `pace`")
    parser.add_argument("--variant", default=FRAME_ARRAY.name, help="for `peak`")
    parser.add_argument("--resolution", help="for `peak`: 800x600")
    parser.add_argument(
        "--cameras", type=int, help="for `view`: repeat an array's cameras to and fro, up to this number"
    )
    parser.add_argument("--frames", type=int, default=2, help="for `peak`")
    parser.add_argument("--avx2", action="store_true", help="no instructions beyond AVX2")
    args = parser.parse_args()
    if args.avx2 and not limited():
        os.execve(sys.executable, [sys.executable, "-m", "bench", *sys.argv[1:]], {**os.environ, **AVX2})
    if args.what in ALONE:
        ALONE[args.what](args)
    elif args.what in APART:
        print(json.dumps(APART[args.what](args), indent=2 if args.what == "first" else None))
    else:
        measure(args)


def measure(args: argparse.Namespace) -> None:
    """Measure jobs, keep the results, and write the tables."""
    out, jobs = folder(args.quick), args.jobs or list(JOBS)
    todo = PARTS if args.what == "all" else (args.what,)
    for name in jobs:
        for what in todo:
            if what in KEPT:
                save(out, f"{what}-{name}", KEPT[what](name, args))
            elif what == "report":
                reports.measure(name)
    if "memory" in todo:
        save(out, "memory", processes.memory(args.quick, jobs))
    if "sizes" in todo:
        save(out, "sizes", processes.sizes(args.quick, jobs))
    if "startup" in todo:
        save(out, "startup", processes.start_up(args.quick))
    if "scaling" in todo:
        save(out, "scaling", scaling.measure(args.quick))
    if args.what == "reported":
        found = load_some(out, {name: f"reported-{name}" for name in JOBS})
        reported.write([row for kept in found.values() for row in kept["rows"]])
    elif args.what != "report":
        tables.write(args.quick)


if __name__ == "__main__":
    main()
