"""Lines that commands print about a render."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from framearray_cli.base.sundays import sun_days
from framearray_cli.base.units import agree, counted, duration, size

if TYPE_CHECKING:
    from framearray_cli.job.job import Job

    from .automatic import AutoSettings
    from .errortarget import Target
    from .events import AmbientEstimated, Chunks, Scanned
    from .manifest import Summary
    from .prepare import Prepared


MOST_DAMAGED = 5  # files listed by name
MOST_DAYS = 12  # of a sun study, listed by date


def size_lines(job: "Job") -> list[str]:
    """Describe the size of an array, before its scene is read."""
    width, height = job.camera.resolution
    n_c, per_camera = job.camera.frames, job.light.frames
    lights = counted(job.light.frames, "light position")
    if job.light.groups:
        unlit = 1 + any(job.scene.background)  # images at which no source shines
        per_camera = sum(group.n for group in job.light.groups) + unlit
        groups = [f"{group.n:,} of {group.name}" for group in job.light.groups]
        lights = f"({' + '.join(groups)} + {unlit} of ambient light and background)"
    images = counted(n_c * per_camera, "image")
    shape = f"{counted(n_c, 'camera position')} x {lights} = {images} of {width} x {height}"
    return [f"array: {shape}", *_sun_lines(job)]


def _sun_lines(job: "Job") -> list[str]:
    """Say which light positions are which time of which day."""
    from framearray_cli.array.manifest import MAIN_AXIS

    lines = []
    for axis, moments in job.light.moments.items():
        spans, of = sun_days(moments), "" if axis == MAIN_AXIS else f" of {axis}"
        lines += [f"sun: {span.text}: {span.indices_text}{of}" for span in spans[:MOST_DAYS]]
        if (more := len(spans) - MOST_DAYS) > 0:
            lines.append(f"sun: {counted(more, 'more day')}, the last {spans[-1].text}: {spans[-1].indices_text}{of}")
    return lines


def scene_lines(prepared: "Prepared") -> list[str]:
    """Describe the contents of a scene, and what was left out of it."""
    from framearray_cli.scene.scene import scene_report_lines

    report, job = prepared.scene.report, prepared.job
    lines, own = scene_report_lines(report, job.scene.file), len(job.light.sources)
    lines += [f"note: {note}" for note in prepared.lights.notes]
    if report.lights > own:
        there = f"the scene file has {counted(report.lights, 'light')}, the job {counted(own, 'source')} of its own"
        lines.append(f"note: {there}, and only these shine; `framearray init` writes jobs with the file's")
    return lines


def ambient_lines(figures: "AmbientEstimated") -> list[str]:
    """Describe the ambient light and its error; only the notes where images have none."""
    error, notes = figures.error, [f"note: {note}" for note in figures.notes]
    if figures.paths == 0:  # light from cells
        return notes
    known = (
        f"standard error at most {error:.1%}, {counted(figures.paths, 'path')}"
        if error > 0
        else "fixed, or nothing arrives"
    )
    lowest, highest = f"{figures.lowest:.4g}", f"{figures.highest:.4g}"
    return [
        f"ambient light: I_A {lowest if lowest == highest else f'{lowest} to {highest}'} ({known})",
        *notes,
    ]


def settings_lines(settings: "AutoSettings") -> list[str]:
    """Describe the chosen settings and their expected results."""
    from .automatic import DEFAULT

    texts = {"reuse.n_r": f"n_r = {settings.reuse.n_r}", "samples.hits": f"hits = {settings.reuse.hits:g}"}
    default = f"n_r = {DEFAULT.n_r}, hits = {DEFAULT.hits:g}"
    lines = [
        f"automatic: {', '.join(texts[key] for key in settings.keys)}; expected: {settings.hits[0]:.1f} hits per pixel "
        f"(1st percentile {settings.hits[1]:.1f}), {settings.error:.2f} times the error that is wanted, "
        f"{settings.time:.2f} times the time of {default}"
    ]
    if not settings.enough:
        lines.append("note: no window reaches the error that is wanted; this one makes the most of its time")
    if settings.seen:
        shares = ", ".join(f"{share:.0%} ({k})" for k, share in settings.seen.items())
        lines.append(f"  hits that are seen that many frames away: {shares}")
    return lines


def target_lines(target: "Target") -> list[str]:
    """Describe the wanted error and the hits allotted for it."""
    least, most = target.frames
    lines = [
        f"error: {target.error:.3g} of the mean radiance is wanted; {target.hits:.1f} native hits per pixel "
        f"({least:.1f} to {most:.1f} by frame) are expected to give {target.expected:.3g}"
    ]
    if target.expected > 1.05 * target.error:
        lines.append(
            f"note: {target.capped:.1%} of all places have as many hits as samples.most_hits allows, "
            "too few for this error"
        )
    return lines


def summary_lines(summary: "Summary", printed: Sequence[str], job: "Job", compiling: float = 0.0) -> list[str]:
    """Describe the cost and result of a render.

    Args:
        printed: notes that were printed before.
        compiling: seconds of the run in which kernels were compiled, which rates leave out.
    """
    from framearray_cli.array.images import FOR_SCREENS

    lines = _cost_lines(summary, compiling) if summary.written else []
    if summary.written and summary.clipped is not None:
        how = "are clipped" if job.output.format in FOR_SCREENS else "are above 1, which a screen clips"
        lines.append(f"{summary.clipped:.1%} of the pixels {how}; {summary.black:.1%} are black")
    if error := summary.standard_error:
        of = f" of {error['group']}" if "group" in error else ""
        lines.append(
            f"standard error {error['rms']:.3g}, {error['relative']:.1%} of the mean radiance; "
            f"the largest of an image {error['largest']:.3g} (camera {error['camera']}, light {error['light']}{of})"
        )
    lines += [f"note: {note}" for note in summary.notes if note not in printed]
    if summary.there < summary.images:
        there = f"{summary.there:,} of {counted(summary.images, 'image')} {agree(summary.there, 'is', 'are')}"
        lines.append(f"{there} there; the rest is left to other runs")
    return [*lines, f"images and manifest: {job.output.directory}"]


def _cost_lines(summary: "Summary", compiling: float) -> list[str]:
    """Describe the cost of this run."""
    kinds = summary.rays_per_pixel_image
    mirrors = sum(n for kind, n in kinds.items() if "mirror" in kind or kind == "pilot")
    rays = sum(kinds.values()) - mirrors - kinds["ambient"]
    seconds = max(summary.seconds - compiling, 1e-3)
    rate = sum(summary.rays.values()) / seconds / 1e6
    more = f" + {mirrors:.2f} for mirrors" if mirrors else ""
    each = f"{1e3 * seconds / summary.written:.1f} ms per image"
    return [
        f"{counted(summary.written, 'image')} in {duration(summary.seconds)}: {each}, "
        f"{summary.written / seconds:.1f} images per second",
        f"{rays:.2f} rays per pixel per image{more}, {rate:.1f} Mrays/s, "
        f"{summary.hits_per_pixel:.1f} hits per pixel, peak memory {size(summary.peak_memory_bytes)}",
    ]


def on_disk_lines(found: "Scanned", *, damaged: bool = True) -> list[str]:
    """Describe the files of an array that are on disk already; `damaged`: list the damaged ones, too."""
    listed, wanted = list(found.damaged.items()) if damaged else [], found.wanted
    lines = [f"damaged: {name}: {problem}" for name, problem in listed[:MOST_DAMAGED]]
    if len(listed) > MOST_DAMAGED:
        lines.append(f"damaged: {counted(len(listed) - MOST_DAMAGED, 'more file')}")
    if found.kept:
        left = f"{wanted:,} {agree(wanted, 'is', 'are')} left" if wanted else "nothing is left to do"
        there = f"{counted(found.kept, 'image')} {agree(found.kept, 'is', 'are')}"
        lines.append(f"{there} there and whole; {left}")
    return lines


def chunks_line(chunks: "Chunks") -> str:
    """Describe the chunks of the camera path: "4 chunks of 24 camera positions; halos add 19% to the hits"."""
    n, sizes = len(chunks.each), sorted({len(chunk) for chunk in chunks.each})
    least = f"{sizes[0]:,} to " if len(sizes) > 1 else ""
    each = f"{least}{counted(sizes[-1], 'camera position')}"
    if n == 1:
        return f"1 chunk of {each}"
    return f"{n:,} chunks of {each}; halos add {chunks.more:.0%} to the hits"
