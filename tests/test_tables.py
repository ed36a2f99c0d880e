"""Measured pages become CSV files, and the files in docs/quality/ are such files."""

import csv
from pathlib import Path

from support import ROOT
from support.tables import csv_of, publish

PAGE = """# Speed

Prose.

| `job` | ms | [note](a.md) |
|---|---:|---|
| **kitchen** | 1,234.5 | a, b |

## Packets

With AVX2:

| | n |
|---|---|
| x | 3 |
"""


def test_tables_of_a_page_become_csv(tmp_path: Path) -> None:
    assert csv_of(PAGE) == '# Speed\njob,ms,note\nkitchen,1234.5,"a, b"\n\n# Packets: With AVX2\n,n\nx,3\n'
    assert publish(tmp_path / "speed.md", PAGE).read_text(encoding="utf-8") == csv_of(PAGE)


def test_published_tables_have_rows_of_one_width() -> None:
    files = sorted((ROOT / "docs" / "quality").glob("*.csv"))
    assert len(files) > 10
    for file in files:
        for part in file.read_text(encoding="utf-8").split("\n\n"):
            title, *lines = part.splitlines()
            rows = list(csv.reader(lines))
            assert title.startswith("# ") and len(rows) > 1 and len({len(row) for row in rows}) == 1, (file, title)
