"""Memory and cores that the system gives this process, also by its control group (a container)."""

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from .platform import usable_cores

ROOT, OWN = Path("/sys/fs/cgroup"), Path("/proc/self/cgroup")  # where groups are mounted, and the names of ours
# Files of a control group by version: its limit, its use, and the key for cached files, which the system drops.
_GROUP_FILES = {
    1: ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"),
    2: ("memory.max", "memory.current", "inactive_file"),
}
SCARCE = 0.1  # of what is held


def available_cores() -> int:
    """Number of cores that this process may use: its affinity, or less where a control group has a quota.

    A quota is rounded up: 2.5 cores count as 3.
    """
    quotas = (_quota(folder, version) for folder, version in _groups("cpu"))
    return min([usable_cores(), *(quota for quota in quotas if quota is not None)])


def _quota(folder: Path, version: int) -> int | None:
    """Number of cores that a group may keep busy, rounded up; None without a limit."""
    try:
        if version == 2:
            time, period = (folder / "cpu.max").read_text().split()
        else:
            time, period = ((folder / f"cpu.cfs_{name}_us").read_text() for name in ("quota", "period"))
        cores = -(-int(time) // int(period))
    except (OSError, ValueError, ZeroDivisionError):  # no such group; "max"
        return None
    return cores if cores > 0 else None  # in version 1, -1 stands for no limit


def group_memory() -> int | None:
    """Bytes that the control groups of this process, and those above them, still allow; None without a limit.

    Swap does not count. Systems without control groups have no limit.
    """
    left = (_group_room(folder, version) for folder, version in _groups("memory"))
    return min((room for room in left if room is not None), default=None)


def _groups(controller: str) -> Iterator[tuple[Path, int]]:
    """Find the groups of this process, from the innermost outwards, each with the version of its files."""
    try:
        lines = OWN.read_text().splitlines()
    except OSError:
        return
    for line in lines:
        _, controllers, place = line.split(":", 2)
        if not controllers:
            base, version = (ROOT if (ROOT / "cgroup.controllers").exists() else ROOT / "unified"), 2
        elif controller in controllers.split(","):
            base, version = ROOT / controller, 1
        else:
            continue
        inner = base / place.lstrip("/")  # in a container perhaps the host's name: missing folders are skipped later
        for folder in (inner, *inner.parents):
            if folder == base or base in folder.parents:
                yield folder, version


def _group_room(folder: Path, version: int) -> int | None:
    """Bytes that one group still allows, with cached files counted as free; None without a limit."""
    limit_file, use_file, cached_key = _GROUP_FILES[version]
    try:
        limit = int((folder / limit_file).read_text())
        used = int((folder / use_file).read_text())
    except (OSError, ValueError):  # no such group; "max"
        return None
    cached = 0
    with suppress(OSError, ValueError):
        rows = (row.split() for row in (folder / "memory.stat").read_text().splitlines())
        cached = next((int(row[1]) for row in rows if row[0] == cached_key), 0)
    return max(limit - used + cached, 0)


def free_memory(*, swap: bool = True) -> int:
    """Bytes that this process can still get: free memory and swap, or less where a container limits it."""
    import psutil

    machine = int(psutil.virtual_memory().available + (psutil.swap_memory().free if swap else 0))
    group = group_memory()
    return machine if group is None else min(machine, group)


def is_scarce(held: int) -> bool:
    """Return True if little memory is free, over some bytes that this process holds.

    Swap does not count as free: what others need should not have to go there.
    """
    return free_memory(swap=False) < SCARCE * held


def total_memory() -> int:
    """Bytes of memory that the machine has."""
    import psutil

    return int(psutil.virtual_memory().total)


def resident_memory() -> int:
    """Bytes that this process holds now: the program, the scene, and Embree's tree if it is built."""
    import psutil

    return int(psutil.Process().memory_info().rss)
