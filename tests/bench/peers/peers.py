"""Other programs, each in a process of its own: where something does not fit, it may end the process."""

import subprocess

from bench.core.results import Table
from bench.speed.processes import asked
from bench.speed.speed import log


def measure(program: str, name: str, quick: bool) -> Table:
    """The cost of an image of a job in another program, or {"skipped": why}."""
    try:
        table = asked(program, name, *(["--quick"] if quick else []))
    except subprocess.CalledProcessError as error:
        table = {"skipped": f"it ended with status {error.returncode}"}
    log(f"{name}: {program}: " + (f"left out: {table['skipped']}" if "skipped" in table else f"{table['ms']:.0f} ms"))
    return table
