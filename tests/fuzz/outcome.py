"""One command in a process of its own, and whether it ended as the program may end.

The process is a copy of this one, in which the program is loaded already, so a case costs hundredths of a second.
"""

import faulthandler
import os
import resource
import signal
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

SECONDS = 10.0  # a case that takes longer hangs
MEMORY = 6 << 30  # bytes of address space beyond what the program has when it starts
LONGEST, WIDEST = 60, 1000  # lines of a message, and characters of a line, that somebody still reads
CODES = (0, 2, 3, 4, 5)


@dataclass(frozen=True)
class Outcome:
    """How a case ended.

    Attributes:
        verdict: "accepted", "refused", or what is wrong.
        code: exit code, negative for a signal; None where the process was stopped.
        message: the end of what it printed on stderr.
    """

    verdict: str
    code: int | None
    seconds: float
    message: str

    @property
    def bad(self) -> bool:
        return self.verdict not in ("accepted", "refused")


def outcome_of(arguments: Sequence[str | Path], log: Path, *, before: Callable[[], None] = lambda: None) -> Outcome:
    """Run a command of the program.

    Args:
        log: file for what it prints on stderr; stdout goes nowhere.
        before: called in the new process first.
    """
    started = time.monotonic()
    child = os.fork()
    if child == 0:
        _become([str(argument) for argument in arguments], log, before)
    code = _wait(child, started + SECONDS)
    message = log.read_text(errors="replace")
    return Outcome(_verdict(code, message), code, time.monotonic() - started, message[-LONGEST * WIDEST // 4 :])


def _become(arguments: list[str], log: Path, before: Callable[[], None]) -> None:
    """Run the command in the new process; never returns."""
    code = 1
    try:
        os.setpgid(0, 0)
        os.dup2(os.open(os.devnull, os.O_RDWR), 0)
        os.dup2(os.open(os.devnull, os.O_RDWR), 1)
        os.dup2(os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), 2)
        used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, used + MEMORY))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        faulthandler.dump_traceback_later(0.9 * SECONDS)  # what it does when it hangs
        from framearray_cli.cli import main

        before()
        main(arguments)
        code = 0
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stderr.flush()
        os._exit(code)


def _wait(child: int, end: float) -> int | None:
    """The exit code of a process, negative for a signal; None when it had to be stopped."""
    pause = 0.0005
    while time.monotonic() < end:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        time.sleep(pause)
        pause = min(2 * pause, 0.01)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return None


def _verdict(code: int | None, message: str) -> str:
    if code is None:
        return "hang"
    if code < 0:
        return f"crash ({signal.Signals(-code).name})"
    if "Traceback" in message:
        return "traceback"
    if "Warning:" in message:
        return "warning of a library"
    if code not in CODES:
        return f"exit code {code}"
    if code == 0:
        return "accepted"
    if not message.strip():
        return "no message"
    lines = message.splitlines()
    return "refused" if len(lines) <= LONGEST and max(map(len, lines)) <= WIDEST else "endless message"
