"""docs/quality/readers.csv, from the results of a run."""

from bench.core.markdown import grid
from bench.core.results import ROOT, Table
from support.tables import publish

from .readers import READERS

PAGE = ROOT / "docs" / "quality" / "readers.md"
HEAD = """
# Readers, led by coverage

`make fuzz-readers` feeds files to each reader in one process: [Atheris](https://github.com/google/atheris) sees which
branches of the program a file reaches, and goes on from files that reach new ones, half of the time with mutations of
its own, half with those of [Broken input](fuzzing.md). A reader may return or refuse, with an error that names the
file; any other exception, a warning of a library, a crash, more than 20 s or 4 GB is a finding.

*Seeds*: whole files that the project makes, and the corpus of earlier runs. *Files*: what reached something new, before
the least ones are kept in `tests/fuzz/corpus/`, which `make test` reads. *Coverage*: branches and functions of the
program that seeds reach, and those that all files reach. *Stops*: processes that a finding or a limit ended.
"""


def write(table: Table) -> None:
    """Write the page from the figures of all kinds."""
    names = ("runs", "seeds", "files", "first", "last", "found", "stops")
    rows = [
        (kind, f"{found['seconds'] / 60:.1f}", *(f"{found[name]:,}" for name in names))
        for kind, found in ((kind, table[kind]) for kind in READERS if kind in table)
    ]
    sums = [sum(found[name] for found in table.values()) for name in ("runs", "files", "found")]
    minutes = sum(found["seconds"] for found in table.values()) / 60
    text = (
        f"{minutes:.0f} minutes: {sums[0]:,} runs, {sums[1]:,} files that reached something new, {sums[2]:,} findings."
    )
    head = ("", "min", "runs", "seeds", "files", "coverage of seeds", "of all", "findings", "stops")
    publish(PAGE, "\n\n".join([HEAD.strip(), text, grid(head, rows)]) + "\n")
