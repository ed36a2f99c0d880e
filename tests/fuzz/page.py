"""docs/fuzzing.md, from the results of all runs."""

from pathlib import Path


def write(results: Path) -> None:
    """Write the page."""
    raise NotImplementedError
