"""Measured tables: numbers as text, CSV files, and the files in docs/quality/."""

import csv
from pathlib import Path

from support import ROOT
from support.tables import Section, number, percent, times, write_csv


def test_numbers() -> None:
    shown = [number(value) for value in (0, 0.00001234, 0.01234, 1.5, 12.345, 123.4, 999.6, 1234.4, 1234567)]
    assert shown == ["0", "0.0000123", "0.0123", "1.5", "12.3", "123", "1000", "1234", "1234567"]
    assert (number(123.4, 2), percent(0.01234, 2), times(1.234)) == ("123", "1.2 %", "1.23x")


def test_tables_without_rows_are_left_out(tmp_path: Path) -> None:
    write_csv(
        tmp_path / "new/a.csv",
        [
            Section("Speed", ("job", "ms"), [("kitchen, cold", "1")]),
            Section("None", ("a",), []),
            Section("X", ("", "n"), [("x", "3")]),
        ],
    )
    assert (tmp_path / "new/a.csv").read_text(
        encoding="utf-8"
    ) == '# Speed\njob,ms\n"kitchen, cold",1\n\n# X\n,n\nx,3\n'


def test_published_tables_have_rows_of_one_width() -> None:
    files = sorted((ROOT / "docs" / "quality").glob("*.csv"))
    assert len(files) > 10
    for file in files:
        for part in file.read_text(encoding="utf-8").split("\n\n"):
            title, *lines = part.splitlines()
            rows = list(csv.reader(lines))
            assert title.startswith("# ") and len(rows) > 1 and len({len(row) for row in rows}) == 1, (file, title)
