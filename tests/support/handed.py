"""Rendered arrays: compare them, also parts with whole ones, and count how often their chunks were started."""

import tomllib
from collections import Counter
from pathlib import Path
from typing import Any

from framearray_cli.array.record import record_files, unseal
from support import tiny

N = 24
WALK = tiny.walk(N, resolution=[80, 60])
JOB: dict[str, Any] = {
    "camera": WALK,
    "output": {"format": "exr"},
    "reuse": {"n_r": 2},
    "ambient": {"paths": 64},
    "samples": {"hits": 8},
    "render": {"threads": 1},
}
# keys of the manifest's summary that differ between runs
EFFORT = {"seconds", "rays", "rays_per_pixel_image", "peak_memory"}


def contents(folder: Path) -> dict[str, bytes]:
    """Return all files of the array except the manifest."""
    return {file.name: file.read_bytes() for file in folder.glob("tiny.*")}


def manifest(folder: Path) -> dict[str, Any]:
    """Return the table of a manifest without effort and folder."""
    table = tomllib.loads((folder / "manifest.toml").read_text())
    table["summary"] = {key: value for key, value in table["summary"].items() if key not in EFFORT}
    del table["job"]["output"]["directory"]
    return table


def same(part: Path, whole: Path) -> bool:
    """Return whether two folders hold the same array, to the last bit; if not, print the first file that differs."""
    found, wanted = contents(part), contents(whole)
    different = sorted(name for name in found.keys() | wanted.keys() if found.get(name) != wanted.get(name))
    if different:
        print(f"{len(different)} files differ, the first: {different[0]}")
    return not different and bool(wanted) and manifest(part) == manifest(whole)


def lines(folder: Path) -> list[tuple[str, dict[str, Any]]]:
    """Return all whole lines of all records, each with the name of its record."""
    return [
        (file.stem, line)
        for file in record_files(folder)
        for line in map(unseal, file.read_bytes().splitlines())
        if line
    ]


def finished(folder: Path) -> Counter[tuple[int, ...]]:
    """Count how often each camera was finished, per block of lights."""
    return Counter((line["c"], *line["lights"]) for _, line in lines(folder) if "c" in line)


def restarted(folder: Path) -> dict[str, int]:
    """Count how often chunks were restarted."""
    times = Counter(name for name, line in lines(folder) if "fingerprint" in line)
    return {name: n - 1 for name, n in times.items() if n > 1}
