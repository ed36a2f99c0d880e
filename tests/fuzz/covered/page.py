"""docs/quality/readers.csv, from the results of a run.

*Files*: what reached something new. *Coverage*: branches and functions that seeds reach, and that all files reach.
*Stops*: processes that a finding or a limit ended.
"""

from bench.core.results import ROOT, Table
from support.tables import Section, write_csv

from .readers import READERS

PAGE = ROOT / "docs" / "quality" / "readers.csv"


def write(table: Table) -> None:
    """Write the table from the figures of all kinds."""
    names = ("runs", "seeds", "files", "first", "last", "found", "stops")
    rows = [
        (kind, f"{table[kind]['seconds'] / 60:.1f}", *(str(table[kind][name]) for name in names))
        for kind in READERS
        if kind in table
    ]
    head = ("", "min", "runs", "seeds", "files", "coverage of seeds", "of all", "findings", "stops")
    write_csv(PAGE, [Section("Readers, led by coverage", head, rows)])
