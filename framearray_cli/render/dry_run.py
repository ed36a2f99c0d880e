"""What a render would remove, keep and write, without touching its folder."""

from collections.abc import Sequence
from dataclasses import dataclass

from framearray_cli.array.folder import check_folder, read_array, removable_files
from framearray_cli.array.integrity import scan_output
from framearray_cli.array.places import brief_frames_text
from framearray_cli.base.units import agree, counted
from framearray_cli.job.job import Job

from .automatic import require_least_memory, resolve_auto
from .identity import identity_of
from .prepare import open_embree, prepare


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedRender:
    """What a render would do.

    Attributes:
        removed: number of files of the array in the folder that would go first.
        kept: number of images that are there and whole; `damaged`: files that would be replaced.
        wanted: cameras that lack an image, of which `images` would be rendered.
    """

    removed: int
    kept: int
    damaged: int
    wanted: tuple[int, ...]
    images: int


def plan_render(job: Job, *, restart: bool, cameras: Sequence[int] | None) -> PlannedRender:
    """Find what a render would do; nothing is written.

    Raises:
        JobError, SceneError, OutputError: as `render`.
    """
    prepared = prepare(job)
    require_least_memory(prepared)
    with open_embree(prepared) as embree:
        prepared, _ = resolve_auto(prepared, embree)
    directory = job.output.directory
    identity = identity_of(prepared, None if restart else read_array(directory))
    old = check_folder(directory, identity, restart=restart)
    chosen = range(prepared.n_cameras) if cameras is None else cameras
    if old is None or restart:
        removed = len(removable_files(old)) if old is not None else 0
        images = len(chosen) * prepared.n_lights
        return PlannedRender(removed=removed, kept=0, damaged=0, wanted=tuple(chosen), images=images)
    on_disk = scan_output(directory, identity.fingerprint, prepared.threads, frozenset(chosen))
    wanted = tuple(on_disk.missing(chosen, range(prepared.n_lights)))
    return PlannedRender(
        removed=0,
        kept=on_disk.images,
        damaged=len(on_disk.damaged),
        wanted=wanted,
        images=len(wanted) * prepared.n_lights,
    )


def planned_lines(planned: PlannedRender, job: Job) -> list[str]:
    """Describe what a render would do."""
    folder, lines = job.output.directory, []
    if planned.removed:
        lines.append(f"would remove {counted(planned.removed, 'file')} of the frame array in {folder}")
    if planned.damaged:
        lines.append(f"would replace {counted(planned.damaged, 'damaged file')}")
    if planned.kept:
        lines.append(f"would keep {counted(planned.kept, 'image')} that {agree(planned.kept, 'is', 'are')} there")
    if not planned.wanted:
        return [*lines, f"would render nothing: {folder} is complete"]
    where = f"{agree(len(planned.wanted), 'camera', 'cameras')} {brief_frames_text(planned.wanted)}"
    return [*lines, f"would render {counted(planned.images, 'image')} of {where} into {folder}"]
