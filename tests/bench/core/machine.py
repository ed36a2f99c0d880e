"""The machine of the measurements, and how busy other programs kept it."""

import os
import platform
import threading
import time
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numba as nb

from framearray_cli import __version__

PACKAGES = ("embreex", "numba", "llvmlite", "numpy", "OpenImageIO", "mitsuba")


def describe() -> dict[str, str]:
    """Name the machine by its parts, never by its name in a network."""
    found = {
        "processor": _processor(),
        "cores": str(os.cpu_count()),
        "memory": _memory(),
        "system": f"{platform.system()} {platform.release().split('-')[0]}, {platform.machine()}",
        "Python": platform.python_version(),
        "framearray": __version__,
    }
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
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
    wide = (
        ", AVX-512" if "avx512f" in fields.get("flags", "") else ", AVX2" if "avx2" in fields.get("flags", "") else ""
    )
    return f"{fields['model name']} ({family}{wide})"


def _memory() -> str:
    import psutil

    return f"{psutil.virtual_memory().total / 2**30:.0f} GiB"


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
    shares: list[float] = []

    def one() -> None:
        wall, cpu = time.perf_counter(), time.thread_time()
        _spin(_STEPS)
        shares.append((time.thread_time() - cpu) / (time.perf_counter() - wall))

    threads = [threading.Thread(target=one) for _ in range(os.cpu_count() or 1)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return max(0.0, 1.0 - sum(shares) / len(shares))


def quiet(patience: float) -> float:
    """Wait until the machine is quiet, or for `patience` seconds; returns the last result of `busy`."""
    started = time.perf_counter()
    while (share := busy()) > QUIET and time.perf_counter() - started < patience:
        time.sleep(2.0)
    return share
