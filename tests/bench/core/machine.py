"""The machine of the measurements, and how busy other programs kept it."""

import os
import platform
import time
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numba as nb
import psutil

from framearray_cli import __version__

PACKAGES = ("embreex", "numba", "llvmlite", "numpy", "OpenImageIO", "mitsuba")


def describe() -> dict[str, str]:
    """Name the machine by its parts, never by its name in a network."""
    found = {
        "processor": _processor(),
        "cores": str(os.cpu_count()),
        "memory": f"{psutil.virtual_memory().total / 2**30:.0f} GiB",
        "system": f"{platform.system()} {platform.release().split('-')[0]}, {platform.machine()}",
        "Python": platform.python_version(),
        "framearray": __version__,
    }
    for package in PACKAGES:
        with suppress(PackageNotFoundError):
            found[package] = version(package)
    return found


def named(machine: Mapping[str, str]) -> str:
    """Name a machine that `describe` described, for a sentence."""
    return f"{machine['processor']}, {machine['cores']} cores"


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    fields: dict[str, str] = {}
    if info.is_file():
        for line in info.read_text().split("\n\n")[0].splitlines():
            key, _, value = line.partition(":")
            fields[key.strip()] = value.strip()
    if "model name" not in fields:
        return platform.processor() or platform.machine()
    family = f"family {fields.get('cpu family', '?')}, model {fields.get('model', '?')}"
    flags = fields.get("flags", "")
    wide = ", AVX-512" if "avx512f" in flags else ", AVX2" if "avx2" in flags else ""
    return f"{fields['model name']} ({family}{wide})"


@nb.njit(nogil=True)
def _spin(n: int) -> float:
    total = 0.0
    for i in range(n):
        total += 1.0 / (i + 1.0)
    return total


_STEPS = 60_000_000  # about a fifth of a second
# The machine counts as quiet if other programs take less of the cores than this.
QUIET = 0.1


def busy() -> float:
    """The share of all cores that other programs take now: that which a loop on every core does not get."""
    _spin(1)
    n = os.cpu_count() or 1

    def share(_thread: int) -> float:
        wall, cpu = time.perf_counter(), time.thread_time()
        _spin(_STEPS)
        return (time.thread_time() - cpu) / (time.perf_counter() - wall)

    with ThreadPoolExecutor(n) as pool:
        return max(0.0, 1.0 - sum(pool.map(share, range(n))) / n)


def quiet(patience: float) -> float:
    """Wait until the machine is quiet, or for `patience` seconds; returns the last result of `busy`."""
    started = time.perf_counter()
    while (share := busy()) > QUIET and time.perf_counter() - started < patience:
        time.sleep(2.0)
    return share
