"""Values of a job that change no pixel, in an array that exists: its manifest takes them over.

Files that exist keep theirs, such as the frame rate in the headers of EXR and PNG files.
"""

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Any

from .manifest import Manifest
from .manifest_toml import write_manifest

LOSSLESS = ("none", "rle", "zip", "zips", "piz")  # kinds of compression: each file names its own, and holds all pixels

# Keys that files depend on only if another key of their table has one of these values.
NEEDS: dict[tuple[str, str], tuple[str, Collection[object]]] = {
    ("output", "compression"): ("format", ("exr",)),
    ("output", "half"): ("format", ("exr",)),
    ("output", "quality"): ("format", ("jpg",)),
    ("output", "exposure"): ("format", ("png", "jpg")),
    ("output", "fps"): ("format", ()),  # files hold it, but no pixel depends on it
    ("obscurance", "tau"): ("falloff", ("exponential",)),
}


def metadata_of(job: Mapping[str, Any]) -> dict[tuple[str, str], Any]:
    """Return the values of a job's table that change no pixel: (table, key) -> value."""
    found = {}
    for (section, key), (other, values) in NEEDS.items():
        table = job.get(section)
        if isinstance(table, Mapping) and key in table and table.get(other) not in values:
            found[section, key] = table[key]
    output = job.get("output")
    if isinstance(output, Mapping) and output.get("compression") in LOSSLESS:
        found["output", "compression"] = output["compression"]
    return found


def metadata_differs(old: Manifest, job: Mapping[str, Any], fps: float) -> bool:
    """Return whether an array must take over values of a job."""
    return old.fps != fps or metadata_of(old.job) != metadata_of(job)


def other_compression(old: Manifest, job: Mapping[str, Any]) -> str | None:
    """Return the lossless compression that a job wants of EXR files, if the array has another one."""
    new = metadata_of(job).get(("output", "compression"))
    is_exr = job.get("output", {}).get("format") == "exr"
    return new if is_exr and new != metadata_of(old.job).get(("output", "compression")) else None


def take_over_metadata(old: Manifest, job: dict[str, Any], fps: float) -> None:
    """Write the values of a job that change no pixel into the manifest of an array; no run may render meanwhile."""
    write_manifest(old.directory, replace(old, fps=fps, job=job))
