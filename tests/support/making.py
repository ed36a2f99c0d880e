"""Exports, movies and sheets with their options as keywords."""

from pathlib import Path
from typing import Any, NamedTuple

from framearray_cli.tools import AssembleResult, ExportResult, SheetResult, contactsheet
from framearray_cli.tools.export import write
from framearray_cli.tools.mixing import SumOptions
from framearray_cli.tools.movie import movie
from framearray_cli.tools.movie.pathfile import Sweep


class Exported(NamedTuple):
    """A finished export: its folder, its content, and what is said about it."""

    target: Path
    result: ExportResult
    notes: tuple[str, ...]
    warnings: tuple[str, ...]


def export_array(out: Path, target: Path, kind: str, *, force: bool = False, **options: Any) -> Exported:
    """Export an array; options as in `ExportOptions`."""
    made = write.export_array(out, target, write.ExportOptions(kind=kind, **options), force=force)
    return Exported(target, *made)


def assemble_movie(out: Path, path: Path | Sweep, target: Path, **options: Any) -> AssembleResult:
    """Assemble a movie; options as in `MovieOptions` and `movie.assemble_movie`."""
    own = {name: options.pop(name) for name in ("progress", "warned", "force") if name in options}
    return movie.assemble_movie(out, path, target, movie.MovieOptions(**options), **own)


def make_sheet(out: Path, target: Path, *, sums: SumOptions | None = None, **options: Any) -> SheetResult:
    """Draw a contact sheet; options as in `SheetOptions` and `contactsheet.make_sheet`."""
    return warned_sheet(out, target, sums=sums, **options)[0]


def warned_sheet(
    out: Path, target: Path, *, sums: SumOptions | None = None, **options: Any
) -> tuple[SheetResult, tuple[str, ...]]:
    """Draw a contact sheet; return its warnings, too."""
    own = {name: options.pop(name) for name in ("progress",) if name in options}
    return contactsheet.make_sheet(out, target, contactsheet.SheetOptions(**options), sums=sums or SumOptions(), **own)
