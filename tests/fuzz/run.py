"""Runs cases one after the other, and counts how they ended."""

import shlex
import shutil
import time
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from bench.core.results import Table

from .case import Case
from .outcome import Outcome, outcome_of, outcomes_of

MESSAGES = 400  # that are kept to be read, the latest of them
SLOWEST = 5
TOGETHER = 25  # cases that share a process: starting one takes half of the time of most cases


def run(cases: Iterable[Case], n: int, seconds: float, kept: Path, scratch: Path) -> Table:
    """Run at most n cases for at most a given time.

    Args:
        kept: folder for what belongs to cases that ended badly; emptied first.
        scratch: folder for what they print.

    Returns:
        What `page` makes tables from.
    """
    shutil.rmtree(kept, ignore_errors=True)
    begin = time.monotonic()
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    times: list[tuple[float, str]] = []
    bad: list[Table] = []
    messages: list[list[str]] = []
    for case, outcome, verdict in all_judged(cases, scratch):
        counts[case.mutation][_column(case, outcome, verdict)] += 1
        times = sorted([*times, (outcome.seconds, case.mutation)], reverse=True)[:SLOWEST]
        if outcome.verdict == "refused":
            messages = [*messages[1 - MESSAGES :], [case.mutation, outcome.message]]
        if verdict not in ("accepted", "refused"):
            bad.append(_keep(case, outcome, verdict, kept / f"{len(bad):03d}"))
        else:
            remove(case.folder)
        if sum(map(Counter.total, counts.values())) >= n or time.monotonic() - begin > seconds:
            break
    return {
        "cases": sum(map(Counter.total, counts.values())),
        "seconds": time.monotonic() - begin,
        "mutations": {name: dict(counts[name]) for name in sorted(counts)},
        "slowest": times,
        "bad": bad,
        "messages": messages,
    }


def all_judged(cases: Iterable[Case], scratch: Path) -> Iterator[tuple[Case, Outcome, str]]:
    """Run cases: how each ended, and the verdict with what else is wrong.

    Those that may share a process do, until one of them ends badly; then each of them runs again in its own process.
    """
    waiting: list[Case] = []
    for case in cases:
        waiting.append(case)
        if case.isolated or len(waiting) == TOGETHER:
            yield from _judged(waiting, scratch)
            waiting = []


def _judged(cases: Sequence[Case], scratch: Path) -> Iterator[tuple[Case, Outcome, str]]:
    shared = outcomes_of([(case.arguments, case.before) for case in cases], scratch) if len(cases) > 1 else None
    for k, case in enumerate(cases):
        outcome = shared[k] if shared else None
        if outcome is None or outcome.bad:
            outcome = outcome_of(case.arguments, scratch / "stderr.txt", before=case.before)
        wrong = None if outcome.bad else case.wrong(outcome)
        yield case, outcome, wrong or outcome.verdict


def _column(case: Case, outcome: Outcome, verdict: str) -> str:
    """The class of a case: the answer of `accepted`, an exit code, or a verdict."""
    if verdict == "accepted":
        return case.accepted()
    return f"exit code {outcome.code}" if verdict == "refused" else verdict


def _keep(case: Case, outcome: Outcome, verdict: str, place: Path) -> Table:
    """Keep the files of a case."""
    place.parent.mkdir(parents=True, exist_ok=True)
    command = shlex.join(str(argument) for argument in case.arguments)
    if case.folder.exists():
        shutil.move(case.folder, place)
    else:
        place.mkdir()
    (place / "case.txt").write_text(f"{verdict}\n{command}\n\n{outcome.message}", errors="backslashreplace")
    return {"mutation": case.mutation, "verdict": verdict, "folder": str(place), "message": outcome.message}


def remove(folder: Path) -> None:
    """Remove a folder, in any state that the case left it."""
    if not folder.exists():
        return
    for place in (folder, *(p for p in folder.rglob("*") if p.is_dir() and not p.is_symlink())):
        place.chmod(0o700)
    shutil.rmtree(folder)
