"""Renders of broken jobs, within limits: little work, in the folder of the case, and examined afterwards."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from framearray_cli.array.images import read_image, read_layers
from framearray_cli.array.integrity import verify
from framearray_cli.array.manifest import array_files
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.render import estimate as check
from framearray_cli.render import render
from framearray_cli.render.automatic import require_least_memory
from framearray_cli.render.prepare import prepare

# A job that takes at most this long is rendered, up to FAR_MORE times as long checked, and beyond that only prepared:
# read, with its scene, and its memory estimated.
MOST_IMAGES, MOST_LIGHTS, MOST_PIXELS, MOST_RAYS, MOST_WALKS, MOST_THREADS = 300, 60, 100_000, 3_000_000, 2_000_000, 64
FAR_MORE = 10
whole_render, whole_check, TRIAL_RAYS = render.render, check.check, check.TRIAL_RAYS
DONE = "done"  # a file in the folder of a case that says which of these it was


def render_small(folder: Path) -> Callable[[], None]:
    """Limit the process of a case: long work is cut short from then on.

    Args:
        folder: where images may be written.
    """

    def hook() -> None:
        check.TRIAL_RAYS, check.MOST_PIXELS = TRIAL_RAYS // 100, check.FEWEST_PIXELS

        def small_check(job: Any) -> Any:
            if size(job) <= FAR_MORE:
                found = whole_check(job)
                (folder / DONE).write_text("checked")
                return found
            require_least_memory(prepare(job))
            (folder / DONE).write_text("prepared")
            raise SystemExit(0)

        def small_render(job: Any, *arguments: Any, **options: Any) -> Any:
            inside = Path(job.output.directory).resolve().is_relative_to(folder.resolve())
            if not inside or size(job) > 1:
                small_check(job)
                raise SystemExit(0)
            summary = whole_render(job, *arguments, **options)
            look_at(job)
            (folder / DONE).write_text("rendered")
            return summary

        render.render, check.check = small_render, small_check

    return hook


def done(folder: Path) -> str:
    """The treatment of an accepted job: rendered, checked or prepared."""
    file = folder / DONE
    return file.read_text() if file.is_file() else "accepted"


def size(job: Any) -> float:
    """The work of a job, relative to the largest that is rendered."""
    groups = job.light.groups
    lights = sum(group.n for group in groups) + 2 if groups else job.light.frames
    hits = {"auto": 16}.get(job.samples.hits, job.samples.hits) if job.samples.error is None else job.samples.most_hits
    n_r = 16 if job.reuse.n_r == "auto" else job.reuse.n_r
    frames = job.camera.frames
    pixels = job.camera.resolution[0] * job.camera.resolution[1]
    hits = max(hits, 1) * (2 * n_r + 1 if frames == 1 else 1) + job.specular.hits * max(job.specular.depth, 1)
    return max(
        frames * lights / MOST_IMAGES,
        lights / MOST_LIGHTS,
        pixels / MOST_PIXELS,
        pixels * frames * hits * (job.samples.obscurance + 4 * n_r + lights * len(job.light.sources)) / MOST_RAYS,
        (job.ambient.paths or 4096) * lights / MOST_WALKS,
        (job.render.threads or 1) / MOST_THREADS,
    )


def look_at(job: Any) -> None:
    """Read all written files.

    Raises:
        AssertionError: a value is not finite.
        FrameArrayError: a file is missing or damaged.
    """
    manifest = read_manifest(job.output.directory)
    for file in array_files(manifest):
        values = (
            np.concatenate([layer.ravel() for layer in read_layers(file).values()])
            if ".layers." in file.name
            else read_image(file)
        )
        assert np.isfinite(values).all(), f"{file.name} has values that are not finite"
    found = verify(job.output.directory, 1, lambda done, total: None)
    assert not found.wrong and not found.unknown, found
