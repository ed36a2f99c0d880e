"""How much memory this process takes, and how much it can still get."""

import sys
from pathlib import Path

import psutil

from .limits import address_space, group_memory


def peak_memory() -> int:
    """Largest resident size of this process so far, bytes."""
    if sys.platform == "win32":
        return int(psutil.Process().memory_info().peak_wset)
    if sys.platform == "linux":  # what getrusage tells includes the process that started this one
        for line in Path("/proc/self/status").read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return int(peak if sys.platform == "darwin" else peak * 1024)  # bytes on macOS, KiB elsewhere


def free_memory() -> int:
    """Bytes that this process can still get: what the machine has, swap included, or less where a limit says so.

    Limits are those of a container or of `ulimit`; see limits.py.
    """
    machine = int(psutil.virtual_memory().available + psutil.swap_memory().free)
    return min([machine, *(left for left in (group_memory(), address_space()) if left is not None)])


def resident_memory() -> int:
    """Bytes that this process holds now: the program, the scene, and Embree's tree once it is built."""
    return int(psutil.Process().memory_info().rss)
