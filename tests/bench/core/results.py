"""Results on the disk: one JSON file per part and job, so that tables can be written without another measurement."""

import json
import os
import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from support import ROOT

RESULTS = ROOT / "out" / "bench"  # git ignores it

Table: TypeAlias = dict[str, Any]


@dataclass(frozen=True)
class Site:
    """Folders of measured tables, plots and pictures."""

    tables: Path
    plots: Path
    pictures: Path


DOCS = Site(tables=ROOT / "docs" / "quality", plots=ROOT / "docs" / "plots", pictures=ROOT / "docs" / "pictures")


def limited() -> str:
    """The instruction set that the measurements are limited to, as `avx2`; "" where they are not."""
    return os.environ.get("FRAMEARRAY_EMBREE", "").removeprefix("isa=")


def folder(quick: bool) -> Path:
    """Folder of results; results of quick runs and of limited instruction sets are kept apart."""
    return RESULTS / limited() / "quick" if quick else RESULTS / limited()


def site_for(quick: bool) -> Site:
    """Folders of tables, plots and pictures; quick runs keep theirs with their results."""
    return Site(*[folder(quick)] * 3) if quick else DOCS


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


def load_some(directory: Path, names: Mapping[str, str]) -> dict[str, Table]:
    """Read the results of some files that exist, by another name."""
    return {name: table for name, file in names.items() if (table := load(directory, file))}


def median(tables: Sequence[Any], of: Callable[[Sequence[float]], float] = statistics.median) -> Any:
    """The median of equal tables of numbers, or another mean, number by number; a key that one lacks counts as 0."""
    if isinstance(tables[0], Mapping):
        keys = dict.fromkeys(key for table in tables for key in table)
        return {key: median([table.get(key, 0.0) for table in tables], of) for key in keys}
    if isinstance(tables[0], list):
        return [median(values, of) for values in zip(*tables, strict=True)]
    return of(tables)
