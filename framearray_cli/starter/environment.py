"""The environment of a scene file -> a source of a first job, and its panorama next to the job file."""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from framearray_cli.base.files import require_new, write_bytes
from framearray_cli.base.openimage import write_environment
from framearray_cli.scene.files import Stage, read_stage

from .model import NotedTable, Start

DIGITS = 4  # significant digits of the intensity


@dataclass(frozen=True, slots=True, kw_only=True)
class PanoramaFiles:
    """Files of a panorama.

    Attributes:
        draft: where it lies while the job is planned; `final`: next to the job file.
        force: replace another file there.
    """

    draft: Path
    final: Path
    force: bool


@contextmanager
def maps_for(scene: Path, job_file: Path, *, force: bool) -> Iterator[PanoramaFiles]:
    """Yield where the panorama of a scene is saved; the draft goes at the end."""
    name = f"{scene.stem}-environment.exr"
    with tempfile.TemporaryDirectory(prefix="framearray-") as folder:
        yield PanoramaFiles(draft=Path(folder) / name, final=job_file.parent / name, force=force)


def environment_light(stage: Stage, maps: PanoramaFiles | None) -> tuple[tuple[NotedTable, ...], tuple[str, ...]]:
    """Save the panorama of the environment of a file, if it has one; also return a note if it is left out.

    Raises:
        OutputError: another file has its name already, or it cannot be written.
    """
    found = stage.environment
    if found is None:
        return (), ()
    if maps is None:
        left = "is left out: no file can lie next to a job on standard output; give --output a name"
        return (), (f"the environment of the file {left}",)
    write_environment(maps.draft, found.pixels)
    if not _is_there(maps):
        require_new(maps.final, force=maps.force)
    height, width, _ = found.pixels.shape
    about = f'the environment "{found.name}" of the file, as a panorama of {width} x {height} pixels'
    intensity = float(f"{found.intensity:.{DIGITS}g}")
    keys = [{"frame": 0, "rotation": 0, "intensity": intensity}]
    table = {"type": "environment", "file": maps.draft, "keys": keys}
    return (NotedTable(table=table, about=(about,), name=found.name),), ()


def planned_panorama(scene: Path, job_file: Path, *, force: bool) -> Path | None:
    """File that the panorama of a scene would be written to; None without one, or if that very file exists.

    Raises:
        SceneError: the scene cannot be read.
        OutputError: another file has its name already.
    """
    with maps_for(scene, job_file, force=force) as maps:
        environment_light(read_stage(scene), maps)
        return maps.final if maps.draft.exists() and not _is_there(maps) else None


def install_environment(start: Start, maps: PanoramaFiles) -> Start:
    """Save the panorama of a job next to its file, and name it there.

    Raises:
        OutputError: it cannot be written.
    """
    drafts = [source.table.get("file") for source in start.sources]
    if maps.draft not in drafts:
        return start
    if not _is_there(maps):
        write_bytes(maps.final, maps.draft.read_bytes())
    sources = (
        replace(source, table=source.table | {"file": maps.final}) if file == maps.draft else source
        for source, file in zip(start.sources, drafts, strict=True)
    )
    start = replace(start, sources=tuple(sources))
    return start.noted(f"Its environment is saved next to the job, as {maps.final.name}.")


def _is_there(maps: PanoramaFiles) -> bool:
    """True if the very panorama lies there already, from an earlier job of the same scene."""
    try:
        return maps.final.is_file() and maps.final.read_bytes() == maps.draft.read_bytes()
    except OSError:
        return False
