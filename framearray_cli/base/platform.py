"""Differences between Linux, macOS and Windows: signals, timers, cores, disks and further processes.

The only door to such calls. Each docstring says what a function does on Windows. `make check` checks types as on all
three systems.
"""

import os
import platform
import signal
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from types import FrameType

WINDOWS = sys.platform == "win32"
ENDING = ("SIGINT", "SIGTERM", "SIGHUP")  # signals that end a program; Windows lacks the last

PACKAGE_PARENT = Path(__file__).resolve().parents[2]


class Stopped(BaseException):
    """A signal asked the program to end, as Ctrl-C does."""

    def __init__(self, signum: int) -> None:
        super().__init__(signum)
        self.signum = signum
        # the exit code that shells expect after a signal
        self.exit_code = 128 + signum
        self.word = "interrupted" if signum == signal.SIGINT else "terminated"


def stopped_by(error: BaseException | None) -> Stopped | None:
    """The signal that caused an exception, if any.

    A signal at the wrong moment can make one of Python's own locks fail ("cannot release un-acquired lock"); its error
    then has `Stopped` as its context.
    """
    while error is not None and not isinstance(error, Stopped):
        error = error.__context__
    return error


def machine_name() -> str:
    """Return the system and its processor: "Linux on aarch64", "Linux (without glibc) on x86_64"."""
    other = "" if sys.platform != "linux" or platform.libc_ver()[0] == "glibc" else " (without glibc)"
    return f"{platform.system()}{other} on {platform.machine()}"


def has_wheels_of_embree() -> bool:
    """Return True if embreex has wheels for this system: Linux with glibc and Windows on x86-64, and macOS.

    pyproject.toml asks for embreex only there, as far as its markers can tell.
    """
    if sys.platform == "darwin":
        return True
    intel = platform.machine().lower() in ("x86_64", "amd64")
    return intel and (sys.platform == "win32" or platform.libc_ver()[0] == "glibc")


def ending_signals() -> tuple[signal.Signals, ...]:
    """Return the signals of this system that end a program."""
    return tuple(number for name in ENDING if (number := getattr(signal, name, None)) is not None)


def is_hangup(number: int) -> bool:
    """Return True if a signal means that the terminal closed; never on Windows."""
    return sys.platform != "win32" and number == signal.SIGHUP


def on_alarm(call: Callable[[FrameType | None], object]) -> None:
    """Have a function called in the main thread when the alarm goes off; never on Windows."""
    if sys.platform != "win32":
        signal.signal(signal.SIGALRM, lambda _, frame: call(frame))


def set_alarm(seconds: float) -> bool:
    """Set the alarm, 0 for none; False where there is no alarm, as on Windows."""
    if sys.platform == "win32":
        return False
    signal.setitimer(signal.ITIMER_REAL, seconds)
    return True


def usable_cores() -> int:
    """Return the number of cores that this process may run on; where the system does not say, all of the machine."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def largest_size() -> int:
    """Return the largest resident size of this process so far, bytes."""
    if sys.platform == "win32":
        import psutil

        return int(psutil.Process().memory_info().peak_wset)
    if sys.platform == "linux":  # getrusage includes the process that started this one
        for line in Path("/proc/self/status").read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return int(peak if sys.platform == "darwin" else peak * 1024)  # bytes on macOS, KiB elsewhere


def free_inodes(folder: Path) -> int | None:
    """Return the number of files that a disk can still hold; None if it has no such limit, as on Windows.

    Raises:
        OSError: the folder cannot be reached.
    """
    if sys.platform == "win32":
        return None
    disk = os.statvfs(folder)
    return disk.f_favail if disk.f_files else None


def python_command(code: str, arguments: Sequence[str] = ()) -> list[str]:
    """Return the command line of this Python that runs some code."""
    return [sys.executable, "-c", code, *arguments]


def python_environment(**more: str) -> dict[str, str]:
    """Return the environment of such a process: this one's, with the place of the program, and `more`."""
    paths = [str(PACKAGE_PARENT), *filter(None, [os.environ.get("PYTHONPATH")])]
    return os.environ | {"PYTHONPATH": os.pathsep.join(paths), "PYTHONSAFEPATH": "1"} | more
