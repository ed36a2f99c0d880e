"""One command in a process of its own, and whether its end is an allowed one.

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

SECONDS = 10.0  # of processor time; a case that takes longer hangs
PATIENCE = 30.0  # seconds to wait for a case, however busy the machine is
MEMORY = 6 << 30  # bytes of address space beyond what the program has when it starts
LONGEST, WIDEST = 60, 1000  # most lines of a message, and characters of a line, that a person reads
CODES = (0, 2, 3, 4, 5)


@dataclass(frozen=True)
class Outcome:
    """How a case ended.

    Attributes:
        verdict: "accepted", "refused", or what is wrong.
        code: exit code, negative for a signal; None where the process was stopped.
        seconds: of processor time; where the process was stopped, how long it was waited for.
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
    child = os.fork()
    if child == 0:
        _limit_itself()
        faulthandler.dump_traceback_later(0.9 * PATIENCE, file=_redirected(log))  # what it does when it hangs
        os._exit(_code_of(arguments, before))
    code, seconds = _wait(child, PATIENCE)
    return _outcome(code, seconds, log)


def outcomes_of(
    commands: Sequence[tuple[Sequence[str | Path], Callable[[], None]]], folder: Path
) -> list[Outcome] | None:
    """Run several commands in one process, one after the other; None if not all of them came to an end there.

    Args:
        commands: arguments, and what is called before.
        folder: for what they print.
    """
    done = folder / "done.txt"
    done.write_text("")
    logs = [folder / f"stderr-{k}.txt" for k in range(len(commands))]
    child = os.fork()
    if child == 0:
        _limit_itself()
        with done.open("w") as results:
            for (arguments, before), log in zip(commands, logs, strict=True):
                started = time.process_time()
                _redirected(log)
                code = _code_of(arguments, before)
                results.write(f"{code} {time.process_time() - started}\n")
                results.flush()
        os._exit(0)
    _wait(child, PATIENCE + len(commands))
    lines = done.read_text().splitlines()
    if len(lines) < len(commands):
        return None
    ends = [line.split() for line in lines]
    return [_outcome(int(code), float(seconds), log) for (code, seconds), log in zip(ends, logs, strict=True)]


def _outcome(code: int | None, seconds: float, log: Path) -> Outcome:
    message = log.read_text(errors="replace")
    verdict = "hang" if seconds > SECONDS else _verdict(code, message)
    return Outcome(verdict, code, seconds, message[-LONGEST * WIDEST // 4 :])


def _limit_itself() -> None:
    """Prepare a new process."""
    os.setpgid(0, 0)
    os.dup2(os.open(os.devnull, os.O_RDWR), 0)
    os.dup2(os.open(os.devnull, os.O_RDWR), 1)
    # pytest puts something else in their place
    sys.stdout, sys.stderr = open(1, "w", closefd=False), open(2, "w", closefd=False)  # noqa: SIM115
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, used + MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _redirected(log: Path) -> int:
    """Send stderr to a file, and stdout, where `verify` says what is wrong."""
    file = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_APPEND)
    os.dup2(file, 1)
    os.dup2(file, 2)
    os.close(file)
    return 2


def _code_of(arguments: Sequence[str | Path], before: Callable[[], None]) -> int:
    """Run a command in this process: its exit code."""
    try:
        from framearray_cli.cli.main import main

        before()
        main([str(argument) for argument in arguments])
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:
        traceback.print_exc()
        return 1
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
    return 0


def _wait(child: int, seconds: float) -> tuple[int | None, float]:
    """The exit code of a process, negative for a signal, None when it had to be stopped; and its processor time."""
    pause, end = 0.0005, time.monotonic() + seconds
    while time.monotonic() < end:
        done, status, used = os.wait4(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status), used.ru_utime + used.ru_stime
        time.sleep(pause)
        pause = min(2 * pause, 0.01)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return None, seconds


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
