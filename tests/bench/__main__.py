"""The command: `python -m bench`, from the folder `tests`."""

import argparse
import json
import os
import sys

from bench.core.cases import (
    FRAME_ARRAY,
    JOBS,
    Variant,
    job_named,
    open_case,
    variant_named,
    with_resolution,
    with_settings,
)
from bench.core.results import folder, limited, load, save
from bench.core.steady import steady
from bench.error import bias, error, reported, reports
from bench.error import bias_page as biaspage
from bench.error import error_page as errorpage
from bench.gloss import against as glossy
from bench.gloss import run as gloss
from bench.lights import against
from bench.lights import run as lights
from bench.peers import cycles, mitsuba3, peers
from bench.speed import first, packets, processes, scaling, speed
from bench.speed import page as table
from bench.truth import flicker
from bench.truth import run as truth
from bench.truth.places import Place
from bench.truth.rendered import METHODS, pace
from bench.truth.traced import trace_here
from bench.view import attack, live
from bench.view import page as viewpage

PROGRAMS = {"mitsuba": mitsuba3.measure, "cycles": cycles.measure}
PARTS = ("speed", "peers", "memory", "startup")
# As `make test-avx2` limits the tests.
AVX2 = {"FRAMEARRAY_EMBREE": "isa=avx2", "NUMBA_CPU_NAME": "x86-64-v3", "NUMBA_CPU_FEATURES": "+avx2"}
OTHERS = (
    "truth",
    "flicker",
    "lights",
    "lights-against",
    "gloss",
    "gloss-against",
    "trace-place",
    "pace",
    "scaling",
    "error",
    "packets",
    "report",
    "bias",
    "reported",
    "page",
    "peak",
    "view",
    "live",
    "attack",
    "first",
)


def main() -> None:
    """Measure the parts asked for, and write the page."""
    parser = argparse.ArgumentParser(
        prog="bench", description="Measure the cost of an image, and write docs/quality/speed.csv."
    )
    parser.add_argument("what", nargs="?", default="all", choices=("all", *OTHERS, *PROGRAMS, *PARTS))
    parser.add_argument("jobs", nargs="*", help="some of the jobs, parts of `lights`, or arrays for `view`")
    parser.add_argument("--quick", action="store_true", help="a small picture, once; the page goes to out/bench/quick")
    parser.add_argument("--runs", type=int, default=speed.RUNS, help="how often each thing is measured")
    parser.add_argument("--patience", type=float, default=0.0, help="seconds to wait for a busy machine, each time")
    parser.add_argument("--part", nargs="*", default=list(bias.MEASURES), choices=bias.MEASURES, help="for `bias`")
    parser.add_argument(
        "--method", nargs="*", default=[], choices=[*METHODS], help="for `truth`, all of them; and one for `pace`"
    )
    parser.add_argument("--variant", default=FRAME_ARRAY.name, help="for `peak`")
    parser.add_argument("--resolution", help="for `peak`: 800x600")
    parser.add_argument("--frames", type=int, default=2, help="for `peak`")
    parser.add_argument("--avx2", action="store_true", help="no instructions beyond AVX2")
    args = parser.parse_args()
    if args.avx2 and not limited():
        os.execve(sys.executable, [sys.executable, "-m", "bench", *sys.argv[1:]], {**os.environ, **AVX2})
    if args.what == "truth":
        truth.run(args.jobs, args.quick, args.method)
        return
    if args.what == "flicker":
        flicker.run(args.jobs, args.quick)
        return
    if args.what == "lights":
        lights.run(args.jobs, args.quick)
        return
    if args.what == "lights-against":
        print(json.dumps(against.measure_here(args.jobs[0], args.quick, folder(args.quick))))
        return
    if args.what == "gloss":
        gloss.run(args.jobs, args.quick)
        return
    if args.what == "gloss-against":
        print(json.dumps(glossy.measure_here(args.jobs[0], args.quick, folder(args.quick))))
        return
    if args.what == "trace-place":
        job, c, l = args.jobs
        print(json.dumps(trace_here(Place(job=job, c=int(c), l=int(l)), args.quick, folder(args.quick))))
        return
    if args.what == "pace":
        print(json.dumps({"ms": pace(args.jobs[0], args.method[0], args.quick)}))
        return
    if args.what == "view":
        viewpage.run(args.jobs, args.patience, args.quick)
        return
    if args.what == "live":
        live.run(args.jobs)
        return
    if args.what == "attack":
        attack.run()
        return
    if args.what == "first":
        print(json.dumps(first.run(args.jobs), indent=2))
        return
    if args.what == "peak":
        print(json.dumps(peak(args.jobs[0], variant_named(args.variant), args)))
        return
    if args.what in PROGRAMS:
        print(json.dumps(PROGRAMS[args.what](args.jobs[0], args.quick)))
        return
    out, jobs = folder(args.quick), args.jobs or list(JOBS)
    if args.what == "reported":
        for name in jobs:
            save(out, f"reported-{name}", {"rows": reported.measure(name, out)})
        reported.write([row for name in JOBS if (kept := load(out, f"reported-{name}")) for row in kept["rows"]])
        return
    if args.what == "error":
        for name in jobs:
            save(out, f"error-{name}", error.measure(name, args.quick, out))
        errorpage.write(args.quick)
        return
    if args.what == "packets":
        for name in jobs:
            save(out, f"packets-{name}", packets.measure(name, args.quick))
        packets.write(args.quick)
        return
    if args.what == "report":
        for name in jobs:
            reports.measure(name)
            reports.write(name)
        return
    if args.what == "bias":
        for name in jobs:
            for part in args.part:
                save(out, f"bias-{name}-{part}", bias.measure_part(name, part, args.quick))
        biaspage.write(args.quick)
        return
    todo = PARTS if args.what == "all" else (args.what,)
    for name in jobs:
        if "speed" in todo:
            save(out, f"speed-{name}", speed.measure(name, args.quick, args.runs, args.patience))
        if "peers" in todo:
            for program in PROGRAMS:
                save(out, f"{program}-{name}", peers.measure(program, name, args.quick))
    if "memory" in todo:
        save(out, "memory", processes.memory(args.quick, jobs))
    if "startup" in todo:
        save(out, "startup", processes.start_up(args.quick))
    if "scaling" in todo:
        save(out, "scaling", scaling.measure(args.quick))
    table.write(args.quick)


def peak(name: str, variant: Variant, args: argparse.Namespace) -> dict[str, object]:
    """Run a variant for a moment; returns its cost, and the peak memory of this process."""
    from framearray_cli.base.platform import largest_size

    job = job_named(name, args.quick)
    if args.resolution:
        job = with_resolution(job, (int(args.resolution.split("x")[0]), int(args.resolution.split("x")[1])))
    with open_case(job) as case:
        before = largest_size()
        measured = steady(with_settings(case, variant.settings), args.frames)
        return {**measured.table(), "peak": largest_size(), "before": before}


if __name__ == "__main__":
    main()
