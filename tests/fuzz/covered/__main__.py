"""The command: `python -m fuzz.covered KINDS... --minutes N`, from the folder `tests`; Linux, Python 3.11 to 3.13.

Corpora stand in `tests/fuzz/corpus/`, a folder per kind: files that reached something new, none of them from elsewhere.
"""

import argparse
import hashlib
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from bench.core.results import ROOT, Table, load, save

from . import page
from .least import least_of
from .readers import READERS, seeds_of

CORPUS = ROOT / "tests" / "fuzz" / "corpus"
RESULTS = ROOT / "out" / "fuzz"  # git ignores it
NAME = "covered"
LARGEST = 20_000  # bytes of a file
SLOWEST = 20  # seconds that one file may take
MEMORY = 4096  # MiB that a process may take
# Lines of libFuzzer: the coverage that the corpus has when a run begins, and that of its end.
COVERAGE = re.compile(r"#(\d+)\s+(INITED|NEW|REDUCE|pulse|DONE|RELOAD)\s+cov: (\d+) ft: (\d+)")


def main() -> None:
    """Fuzz kinds one after the other, the same time each; keep what reached something new."""
    parser = argparse.ArgumentParser(prog="fuzz.covered", description="Feed files to readers, led by coverage.")
    parser.add_argument("kinds", nargs="*", default=[*READERS], help='of files; all by default; "page" writes the page')
    parser.add_argument("--minutes", type=float, default=60.0, help="of all kinds together")
    parser.add_argument("--keep", action="store_true", help="make the corpus the least files that run the same lines")
    args = parser.parse_args()
    table: Table = load(RESULTS, NAME) or {}
    if args.kinds == ["page"]:
        page.write(table)
        return
    for kind in args.kinds:
        table[kind] = _sum(table.get(kind), covered(kind, 60 * args.minutes / len(args.kinds), args.keep))
        save(RESULTS, NAME, table)
        print(kind, {key: value for key, value in table[kind].items()}, flush=True)


def covered(kind: str, seconds: float, keep: bool) -> Table:
    """Fuzz one kind; returns its figures."""
    found = RESULTS / NAME / kind.replace(" ", "-")
    shutil.rmtree(found, ignore_errors=True)
    found.mkdir(parents=True)
    kept = CORPUS / kind.replace(" ", "-")
    with tempfile.TemporaryDirectory(prefix="corpus-") as name:
        corpus = Path(name) / "corpus"
        corpus.mkdir()
        for data in [*seeds_of(READERS[kind], Path(name) / "seeds"), *(f.read_bytes() for f in kept.glob("*"))]:
            (corpus / hashlib.sha256(data).hexdigest()[:16]).write_bytes(data)
        seeds = len(list(corpus.iterdir()))
        begin = time.monotonic()
        runs, first, last, stops = 0, 0, 0, 0
        while (left := seconds - (time.monotonic() - begin)) > 1:
            figures = _fuzz(kind, corpus, found, f"-max_total_time={left:.0f}")
            runs, first, last = runs + figures[0], first or figures[1], max(last, figures[2])
            stops += 1
        if keep:
            least = least_of(READERS[kind], corpus)
            shutil.rmtree(kept, ignore_errors=True)
            kept.mkdir(parents=True)
            for file in least:
                shutil.copy(file, kept)
        files = len(list(corpus.iterdir()))
    return {
        "seconds": time.monotonic() - begin, "runs": runs, "seeds": seeds, "files": files, "first": first,
        "last": last, "found": len(list(found.glob("*.txt"))), "stops": stops - 1,
    }  # fmt: skip


def _sum(before: Table | None, now: Table) -> Table:
    """The figures of several runs of a kind."""
    if before is None:
        return now
    added = {key: before[key] + now[key] for key in ("seconds", "runs", "files", "found", "stops")}
    return {**before, **added, "last": max(before["last"], now["last"])}


def _fuzz(kind: str, corpus: Path, found: Path, *options: str) -> tuple[int, int, int]:
    """Run libFuzzer once: runs, coverage at the begin and at the end."""
    limits = (f"-max_len={LARGEST}", f"-timeout={SLOWEST}", f"-rss_limit_mb={MEMORY}", "-print_final_stats=1")
    command = [sys.executable, "-m", "fuzz.covered.one", kind, str(corpus), str(found), *limits, *options]
    path = os.pathsep.join([".", str(ROOT)])  # the program of this checkout, wherever another one is installed
    log = found / "log"
    with log.open("ab") as output:
        begin = log.stat().st_size
        subprocess.run(
            command, cwd=ROOT / "tests", env={**os.environ, "PYTHONPATH": path}, stdout=output, stderr=output
        )
    lines = COVERAGE.findall(log.read_bytes()[begin:].decode(errors="replace"))
    if not lines:
        return 0, 0, 0
    return int(lines[-1][0]), next((int(c) for _, what, c, _ in lines if what == "INITED"), 0), int(lines[-1][2])


if __name__ == "__main__":
    main()
