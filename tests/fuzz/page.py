"""docs/quality/fuzzing.csv, from the results of all runs."""

import json
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from bench.core.markdown import grid
from bench.core.results import ROOT, Table
from support.tables import publish

from .outcome import MEMORY, PATIENCE, SECONDS

PAGE = ROOT / "docs" / "quality" / "fuzzing.md"
HEAD = f"""
# Broken input

Every outcome is a picture or one clear message with the right exit code. `make fuzz` breaks small files by the
thousand and hands each to a command of the program: `tests/fuzz/` says how. A case is bad if there is a traceback, a
crash, a warning of a library, an exit code that is not in [the list](../reference/command-line.md#errors), no message,
a message of more than 60 lines or with a line of more than 1000 letters, more than {SECONDS:.0f} s of processor time,
no end within {PATIENCE:.0f} s, or more than {MEMORY >> 30} GiB.
Cases run in a process of their own, or 25 in one; if one of these ends badly, all of them run again, each in its own
process.
"""
KINDS = {
    "jobs": """
## Job files

Small jobs that use every key, and those of `jobs/`, changed in four ways: their tables (any value at any place, keys
missing, added, renamed or moved), their bytes, extreme values that are allowed, and other things in place of a
file. The run renders an accepted job if that takes a moment; every value of every image must then be finite, the
manifest readable, and `verify` content. It checks one that takes up to ten times as long (`framearray check`, with
smaller probes), and prepares a larger one: it reads the scene and estimates the memory.
""",
    "scenes": """
## Scene files

Scenes of every format, with every feature of the format, changed in their bytes and in their structure; real ones, too,
where they are installed.
""",
    "paths": """
## Paths of movies, and options

Path files for `assemble`, changed like job files; and odd values of the options of `assemble`, `sheet`, `export` and
`view`. Movies have at most 300 frames here.
""",
    "manifests": """
## Manifests and images

Manifests, changed like job files; file patterns that lead out of the folder; images that are damaged, missing, another
one, a link, or no file. Then any command that reads an array runs, or a render that continues. Files beside the array
must stay as they were. Manifests have at most 4 MB: Python's reader of TOML takes 14 s for 10 MB, which we accept.
""",
    "records": """
## Records

The lists of finished files: bytes and lines changed, also by somebody who knows their checksums, and other things in
their folder. A render continues, or `verify` runs. Where a render ends well after damage, all images must have the
bytes of one that was never stopped.
""",
}
CODES = ("exit code 2", "exit code 3", "exit code 4", "exit code 5")


def write(results: Path) -> None:
    """Write the page from every result in a folder."""
    tables = [json.loads(file.read_text(encoding="utf-8")) for file in sorted(results.glob("*.json"))]
    parts = [HEAD.strip(), summary(tables)]
    for kind, text in KINDS.items():
        own = [table for table in tables if table["kind"] == kind]
        if own:
            parts += [text.strip(), by_mutation(own)]
    publish(PAGE, "\n\n".join(parts) + "\n")


def counts(tables: Sequence[Table]) -> dict[str, Counter[str]]:
    """Cases by mutation and by how they ended."""
    found: dict[str, Counter[str]] = {}
    for table in tables:
        for name, ends in table["mutations"].items():
            found.setdefault(name, Counter()).update(ends)
    return found


def summary(tables: Sequence[Table]) -> str:
    """One row per kind."""
    rows = []
    for kind in KINDS:
        own = [table for table in tables if table["kind"] == kind]
        ends = sum(counts(own).values(), Counter())
        if not ends:
            continue
        bad = sum(len(table["bad"]) for table in own)
        slowest = max(seconds for table in own for seconds, _ in table["slowest"])
        minutes = sum(table["seconds"] for table in own) / 60
        accepted = ends.total() - bad - sum(ends[code] for code in CODES)
        refused = [f"{ends[code]:,}" for code in CODES]
        rows.append(
            [kind, f"{ends.total():,}", f"{accepted:,}", *refused, str(bad), f"{slowest:.1f}", f"{minutes:.0f}"]
        )
    head = ("", "cases", "accepted", *(code.replace("exit ", "") for code in CODES), "bad", "slowest, s", "min")
    return grid(head, rows)


def by_mutation(tables: Sequence[Table]) -> str:
    """One row per mutation, with the ways of ending that occurred."""
    found = counts(tables)
    ends = sum(found.values(), Counter())
    columns = sorted(set(ends) - set(CODES)) + [code for code in CODES if code in ends]
    rows = [[name, str(own.total()), *(str(own[column] or "") for column in columns)] for name, own in found.items()]
    return grid(("", "cases", *columns), rows)
