"""Results on the disk: one JSON file per part and job, so that pages can be written without another measurement."""

import json
import os
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from support import ROOT

RESULTS = ROOT / "out" / "bench"  # git ignores it

Table: TypeAlias = dict[str, Any]


@dataclass(frozen=True)
class Site:
    """The folders of measured pages, and of the plots and pictures that they show."""

    pages: Path
    plots: Path
    pictures: Path

    def link(self, file: Path) -> str:
        """The link from a page to a plot or a picture."""
        return Path(os.path.relpath(file, self.pages)).as_posix()


def site_in(results: Path) -> Site:
    """Pages, plots and pictures beside their results."""
    return Site(pages=results, plots=results / "plots", pictures=results / "pictures")


DOCS = Site(pages=ROOT / "docs" / "quality", plots=ROOT / "docs" / "plots", pictures=ROOT / "docs" / "pictures")


def limited() -> str:
    """The instruction set that the measurements are limited to, as `avx2`; "" where they are not."""
    return os.environ.get("FRAMEARRAY_EMBREE", "").removeprefix("isa=")


def folder(quick: bool) -> Path:
    """Where results go; those of quick runs and of limited instruction sets are kept apart."""
    return RESULTS / limited() / "quick" if quick else RESULTS / limited()


def site_for(quick: bool) -> Site:
    """Where pages go; those of quick runs stay beside their results."""
    return site_in(folder(quick)) if quick else DOCS


def save(directory: Path, name: str, table: Mapping[str, Any]) -> None:
    """Write one result."""
    directory.mkdir(parents=True, exist_ok=True)
    (directory / f"{name}.json").write_text(json.dumps(table, indent=1) + "\n", encoding="utf-8")


def load(directory: Path, name: str) -> Table | None:
    """Read one result, or None where it was not measured."""
    file = directory / f"{name}.json"
    if not file.is_file():
        return None
    table: Table = json.loads(file.read_text(encoding="utf-8"))
    return table


def median(tables: Sequence[Any]) -> Any:
    """The median of equal tables of numbers, number by number; a key that one lacks counts as 0 there."""
    if isinstance(tables[0], Mapping):
        keys = dict.fromkeys(key for table in tables for key in table)
        return {key: median([table.get(key, 0.0) for table in tables]) for key in keys}
    if isinstance(tables[0], list):
        return [median(values) for values in zip(*tables, strict=True)]
    return statistics.median(tables)
