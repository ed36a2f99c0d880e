"""The command: `python -m fuzz KIND --cases N --seed S`, from the folder `tests`; `python -m fuzz page` afterwards."""

import argparse
import importlib
import os
import random
import sys
import tempfile
from pathlib import Path

from bench.core.results import ROOT, save

from . import page
from .run import run
from .warm import warm

# Kinds of input, and the module that mutates each.
KINDS = {
    "jobs": "jobfiles",
    "scenes": "scenefiles",
    "paths": "pathfiles",
    "manifests": "manifests",
    "records": "recordfiles",
}
RESULTS = ROOT / "out" / "fuzz"  # git ignores it


def main() -> None:
    """Run cases of one kind or of all, and keep their results; or write the page."""
    parser = argparse.ArgumentParser(
        prog="fuzz", description="Break input by the thousand; write docs/quality/fuzzing.csv."
    )
    parser.add_argument("what", nargs="?", default="all", choices=(*KINDS, "all", "page"))
    parser.add_argument("--cases", type=int, default=1_000_000, help="how many, of each kind")
    parser.add_argument("--seed", type=int, default=0, help="results of every seed are kept")
    parser.add_argument("--minutes", type=float, default=10.0, help="no case is begun after that time")
    parser.add_argument("--only", default="", help="only cases whose mutation has this text in its name")
    args = parser.parse_args()
    if args.what == "page":
        page.write(RESULTS)
        return
    kinds = list(KINDS) if args.what == "all" else [args.what]
    with tempfile.TemporaryDirectory(prefix="fuzz-") as name:
        os.environ["TMPDIR"] = tempfile.tempdir = name  # what stopped cases leave there is removed, too
        warm(Path(name))
        bad = [fuzz(kind, args, 60 * args.minutes / len(kinds), Path(name) / kind) for kind in kinds]
    sys.stdout.flush()
    os._exit(any(bad))  # libraries would report what they leave behind


def fuzz(kind: str, args: argparse.Namespace, seconds: float, scratch: Path) -> int:
    """Run cases of one kind; returns the number of bad ones."""
    scratch.mkdir()
    kept = RESULTS / f"{kind}-{args.seed}"
    cases = importlib.import_module(f"fuzz.{KINDS[kind]}").cases
    wanted = (case for case in cases(random.Random(f"{kind} {args.seed}"), scratch) if args.only in case.mutation)
    table = run(wanted, args.cases, seconds, kept, scratch)
    save(RESULTS, kept.name, {"kind": kind, "seed": args.seed, **table})
    for bad in table["bad"]:
        print(f"{bad['mutation']}: {bad['verdict']}; kept in {bad['folder']}")
    print(f"{kind}: {table['cases']} cases in {table['seconds']:.0f} s, {len(table['bad'])} bad", flush=True)
    return len(table["bad"])


if __name__ == "__main__":
    main()
