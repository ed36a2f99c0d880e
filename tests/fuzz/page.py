"""docs/quality/fuzzing.csv, from the results of all runs.

A case is bad with a traceback, a crash, a warning of a library, another exit code than the documented ones, no message,
a message of more than 60 lines or with a line of more than 1000 letters, or more time or memory than `outcome` allows.
"""

import json
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

from bench.core.results import ROOT, Table
from support.tables import Section, write_csv

PAGE = ROOT / "docs" / "quality" / "fuzzing.csv"
KINDS = {
    "jobs": "Job files",
    "scenes": "Scene files",
    "paths": "Paths of movies, and options",
    "manifests": "Manifests and images",
    "records": "Records",
}
CODES = ("exit code 2", "exit code 3", "exit code 4", "exit code 5")


def write(results: Path) -> None:
    """Write the tables from every result in a folder."""
    tables = [json.loads(file.read_text(encoding="utf-8")) for file in sorted(results.glob("*.json"))]
    kinds = {kind: [table for table in tables if table["kind"] == kind] for kind in KINDS}
    head = ("", "cases", "accepted", *(code.replace("exit ", "") for code in CODES), "bad", "slowest, s", "min")
    rows = [summary(kind, own) for kind, own in kinds.items() if own]
    write_csv(PAGE, [Section("Broken input", head, rows), *by_mutation(kinds)])


def counts(tables: Sequence[Table]) -> dict[str, Counter[str]]:
    """Cases by mutation and by how they ended."""
    found: dict[str, Counter[str]] = {}
    for table in tables:
        for name, ends in table["mutations"].items():
            found.setdefault(name, Counter()).update(ends)
    return found


def summary(kind: str, own: Sequence[Table]) -> list[str]:
    """One row per kind."""
    ends = sum(counts(own).values(), Counter())
    bad = sum(len(table["bad"]) for table in own)
    slowest = max(seconds for table in own for seconds, _ in table["slowest"])
    minutes = sum(table["seconds"] for table in own) / 60
    accepted = ends.total() - bad - sum(ends[code] for code in CODES)
    codes = [ends[code] for code in CODES]
    return [kind, *map(str, (ends.total(), accepted, *codes, bad)), f"{slowest:.1f}", f"{minutes:.0f}"]


def by_mutation(kinds: dict[str, list[Table]]) -> Iterable[Section]:
    """One row per mutation, with the ways of ending that occurred."""
    for kind, own in kinds.items():
        found = counts(own)
        ends = sum(found.values(), Counter())
        columns = sorted(set(ends) - set(CODES)) + [code for code in CODES if code in ends]
        rows = [
            [name, str(one.total()), *(str(one[column] or "") for column in columns)] for name, one in found.items()
        ]
        yield Section(KINDS[kind], ("", "cases", *columns), rows)
