"""Memory, cores and address space that the system gives this process, also by its control group (a container)."""

import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from .errors import LimitError
from .platform import limit_of, usable_cores

ROOT, OWN, STATUS = Path("/sys/fs/cgroup"), Path("/proc/self/cgroup"), Path("/proc/self/status")
# Address space and data that compiled libraries need. Measured on 2 cores: a render with 4 threads needs
# 1.45 GiB and 0.38 GiB, a movie 0.43 GiB and 0.16 GiB. With less, a library may abort the process without a message.
RENDER_NEEDS = {"RLIMIT_AS": 3 * 2**29, "RLIMIT_DATA": 2**29}
READ_NEEDS = {"RLIMIT_AS": 2**29, "RLIMIT_DATA": 2**28}
# The linear algebra of numpy and of scipy each keep a buffer of 40 MiB per core beyond those measured.
BYTES_PER_CORE, MEASURED_CORES, MOST_CORES = 80 * 2**20, 2, 64
ULIMIT = {"RLIMIT_AS": "-v", "RLIMIT_DATA": "-d"}
_USED = {"RLIMIT_AS": "VmSize:", "RLIMIT_DATA": "VmData:"}


# Files of a control group by version: its limit, its use, and the key for cached files, which the system drops.
_GROUP_FILES = {
    1: ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"),
    2: ("memory.max", "memory.current", "inactive_file"),
}


def available_cores(root: Path = ROOT, own: Path = OWN) -> int:
    """Number of cores that this process may use: its affinity, or less where a control group has a quota.

    A quota is rounded up: 2.5 cores count as 3.

    Args:
        root: folder where the groups are mounted.
        own: file that names the groups of this process.
    """
    cores = usable_cores()
    quotas = (_quota(folder, version) for folder, version in _groups("cpu", root, own))
    return min([cores, *(quota for quota in quotas if quota is not None)])


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


def group_memory(root: Path = ROOT, own: Path = OWN) -> int | None:
    """Bytes that the control groups of this process, and those above them, still allow; None without a limit.

    Swap does not count. Systems without control groups have no limit.

    Args:
        root: folder where the groups are mounted.
        own: file that names the groups of this process.
    """
    left = (_group_room(folder, version) for folder, version in _groups("memory", root, own))
    return min((room for room in left if room is not None), default=None)


def _groups(controller: str, root: Path, own: Path) -> Iterator[tuple[Path, int]]:
    """Find the groups of this process, from the innermost outwards, each with the version of its files."""
    try:
        lines = own.read_text().splitlines()
    except OSError:
        return
    for line in lines:
        _, controllers, place = line.split(":", 2)
        if not controllers:
            base, version = (root if (root / "cgroup.controllers").exists() else root / "unified"), 2
        elif controller in controllers.split(","):
            base, version = root / controller, 1
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


def address_space() -> int | None:
    """Bytes that `ulimit -v` and `ulimit -d` still allow; None without such a limit."""
    left = [limit - _used(name) for name, limit in _limits().items()]
    return max(min(left), 0) if left else None


def require_address_space(needs: dict[str, int]) -> None:
    """Fail early where a library would otherwise abort the process without a message.

    Args:
        needs: name of a limit -> bytes that the program takes on a machine with 2 cores.

    Raises:
        LimitError: a limit is too low.
    """
    cores = min(os.cpu_count() or 1, MOST_CORES)  # all cores: the libraries ignore quotas
    for name, limit in _limits().items():
        needed = needs[name] + max(cores - MEASURED_CORES, 0) * BYTES_PER_CORE
        if limit < needed:
            flag = ULIMIT[name]
            raise LimitError(
                f"`ulimit {flag}` lets this program have {limit / 2**30:.2f} GiB; it needs {needed / 2**30:.2f} GiB "
                f"before any job; `ulimit {flag} unlimited` lifts the limit"
            )


def _limits() -> dict[str, int]:
    """Limits that are set for this process, bytes."""
    return {name: limit for name in ULIMIT if (limit := limit_of(name)) is not None}


def _used(name: str) -> int:
    """Bytes that this process uses of what a limit applies to; 0 where the system does not report it."""
    with suppress(OSError):
        for line in STATUS.read_text().splitlines():
            if line.startswith(_USED[name]):
                return int(line.split()[1]) * 1024
    return 0


def free_memory() -> int:
    """Bytes that this process can still get: free memory and swap, or less where a container or `ulimit` limits it."""
    import psutil

    machine = int(psutil.virtual_memory().available + psutil.swap_memory().free)
    return min([machine, *(left for left in (group_memory(), address_space()) if left is not None)])


def total_memory() -> int:
    """Bytes of memory that the machine has."""
    import psutil

    return int(psutil.virtual_memory().total)


def resident_memory() -> int:
    """Bytes that this process holds now: the program, the scene, and Embree's tree if it is built."""
    import psutil

    return int(psutil.Process().memory_info().rss)
