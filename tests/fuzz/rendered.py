"""Renders of broken jobs, within limits: of little work, in the folder of the case, and looked at afterwards."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

# A job is rendered where it takes at most so much; else it is checked alone.
MOST_IMAGES, MOST_RAYS, MOST_WALKS, MOST_THREADS = 300, 3_000_000, 2_000_000, 64
CHECKED_ONLY = "checked-only"  # a file in the folder of a case


def render_small(folder: Path) -> Callable[[], None]:
    """What is called in the process of the case: renders of small jobs alone go on from then on.

    Args:
        folder: where images may be written.
    """

    def hook() -> None:
        from framearray_cli import check, render

        whole = render.render
        check.PROBE_RAYS, check.MOST_PIXELS = check.PROBE_RAYS // 100, check.FEWEST_PIXELS

        def small(job: Any, *arguments: Any, **options: Any) -> Any:
            inside = Path(job.output.directory).resolve().is_relative_to(folder.resolve())
            if not inside or not is_small(job):
                (folder / CHECKED_ONLY).touch()
                check.check(job)
                raise SystemExit(0)
            summary = whole(job, *arguments, **options)
            look_at(job)
            return summary

        render.render = small

    return hook


def is_small(job: Any) -> bool:
    """Whether a job is rendered in a moment."""
    groups = job.light.groups
    lights = sum(group.n for group in groups) + 2 if groups else job.light.frames
    hits = {"auto": 16}.get(job.samples.hits, job.samples.hits) if job.samples.error is None else job.samples.most_hits
    n_r = 16 if job.reuse.n_r == "auto" else job.reuse.n_r
    pixels = job.camera.resolution[0] * job.camera.resolution[1]
    hits = max(hits, 1) * (job.camera.frames if n_r or job.camera.frames == 1 else 1)
    of_mirrors = job.specular.hits * job.camera.frames
    rays = pixels * (hits + of_mirrors * max(job.specular.depth, 1)) * (job.samples.obscurance + 4 * n_r + lights)
    return (
        job.camera.frames * lights <= MOST_IMAGES
        and rays <= MOST_RAYS
        and (job.ambient.paths or 4096) * lights <= MOST_WALKS
        and (job.render.threads or 1) <= MOST_THREADS
    )


def look_at(job: Any) -> None:
    """Read everything that was written.

    Raises:
        AssertionError: a value is not finite.
        FrameArrayError: a file is missing or damaged.
    """
    from framearray_cli.images import read_image, read_layers
    from framearray_cli.manifest import array_files
    from framearray_cli.manifestfile import read_manifest
    from framearray_cli.verify import verify

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
