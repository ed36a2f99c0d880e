"""What commands print of what they found."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from .screen import duration, size

if TYPE_CHECKING:
    from .check import Estimate
    from .job import Job
    from .prepare import Prepared
    from .report import Report
    from .resume import Found
    from .summary import Summary
    from .terms.ambient import Ambient
    from .verify import Verified


MOST_DAMAGED = 5  # files that are told by name


def estimate_lines(estimate: "Estimate") -> list[str]:
    """What a job holds, and what it will take."""
    prepared = estimate.prepared
    n_c, n_l, job = prepared.n_cameras, prepared.n_lights, prepared.job
    width, height = job.camera.resolution
    return [
        *scene_lines(prepared),
        *(estimate.choice.lines() if estimate.choice else []),
        *ambient_lines(estimate.ambient),
        *(estimate.target.lines() if estimate.target else []),
        f"array: {n_c:,} cameras x {_light_count(prepared)} = {n_c * n_l:,} images of {width} x {height}",
        f"memory: about {size(estimate.memory)}, {size(estimate.available)} free{_blocks(estimate.blocks)}",
        f"disk: about {size(estimate.disk)} in {job.output.directory}, {size(estimate.free)} free",
        f"time: about {duration(estimate.seconds)} on this machine",
        *(f"warning: {warning}" for warning in estimate.warnings),
    ]


def _light_count(prepared: "Prepared") -> str:
    """What is stored for each camera."""
    lights = prepared.lights
    if not lights.groups:
        return f"{lights.n:,} lights"
    groups = [f"{len(group.positions):,} of {group.name}" for group in lights.groups]
    return f"({' + '.join(groups)} + {len(lights.unlit)} of ambient light and background)"


def _blocks(n: int) -> str:
    return f"; the lights are rendered in {n} blocks, one after the other" if n > 1 else ""


def scene_lines(prepared: "Prepared") -> list[str]:
    """What a scene holds, and what was left out of it."""
    from .scene import report_lines

    return report_lines(prepared.scene.report, prepared.job.scene.file)


def ambient_lines(ambient: "Ambient") -> list[str]:
    """The ambient light, and how well it is known."""
    mean = ambient.intensity.mean(axis=1)
    error = ambient.standard_error.max()
    known = f"standard error at most {error:.1%}, {ambient.paths:,} paths" if error > 0 else "fixed, or nothing arrives"
    return [
        f"ambient light: I_A {mean.min():.4g} to {mean.max():.4g} ({known})",
        *(f"  note: {note}" for note in ambient.notes),
    ]


def summary_lines(summary: "Summary", told: Sequence[str], job: "Job") -> list[str]:
    """What a render took.

    Args:
        told: notes that were printed before.
    """
    there = f"{summary.there:,} of {summary.total:,} images"
    return [
        *(_cost_lines(summary) if summary.images else []),
        *_error_lines(summary),
        *(f"note: {note}" for note in summary.notes if note not in told),
        *([f"{there} are there; the rest is left to other runs"] if summary.there < summary.total else []),
        f"images and manifest: {job.output.directory}",
    ]


def _cost_lines(summary: "Summary") -> list[str]:
    """What this run took."""
    kinds = summary.rays_per_pixel_image
    mirrors = sum(n for kind, n in kinds.items() if "mirror" in kind or kind == "pilot")
    rays = sum(kinds.values()) - mirrors - kinds["ambient"]
    rate = sum(summary.rays.values()) / summary.seconds / 1e6
    beside = f" + {mirrors:.2f} for mirrors" if mirrors else ""
    each = f"{1e3 * summary.seconds / summary.images:.1f} ms an image"
    return [
        f"{summary.images:,} images in {duration(summary.seconds)}: {each}, "
        f"{summary.images / summary.seconds:.1f} images a second",
        f"{rays:.2f} rays a pixel an image{beside}, {rate:.1f} Mrays/s, "
        f"{summary.hits:.1f} hits a pixel, peak memory {size(summary.peak_memory)}",
    ]


def found_lines(found: "Found", wanted: int) -> list[str]:
    """What of an array is there already."""
    lines = [f"damaged: {name}: {problem}" for name, problem in found.damaged[:MOST_DAMAGED]]
    if len(found.damaged) > MOST_DAMAGED:
        lines.append(f"damaged: {len(found.damaged) - MOST_DAMAGED:,} files more")
    if found.images:
        left = f"{wanted:,} are left" if wanted else "nothing is left to do"
        lines.append(f"{found.images:,} images are there and whole; {left}")
    return lines


def _error_lines(summary: "Summary") -> list[str]:
    """How noisy the images are, where the job asks."""
    found = summary.standard_error
    if not found:
        return []
    where = f"camera {found['camera']}, light {found['light']}"
    where += f" of {found['group']}" if "group" in found else ""
    return [
        f"standard error {found['rms']:.3g}, {found['relative']:.1%} of the mean radiance; "
        f"the largest of an image {found['largest']:.3g} ({where})"
    ]


def report_lines(made: "Report") -> list[str]:
    """What a report found: the job's own settings, and the cheapest ones for some errors."""
    from .report import advice_lines

    own = made.measured[0]
    lines = [f"as the job says: {own.ms:.3g} ms an image before writing, RMSE {own.quality.rmse:.1%}"]
    for one in made.advice:
        found = f"{one.best.named.name}, {one.best.ms:.3g} ms an image" if one.best else "nothing that was tried"
        lines += [f"for an RMSE of {one.error:.1%}: {found}", *(f"  {line}" for line in advice_lines(one.best, made))]
    return [*lines, f"report: {made.folder / 'index.html'}"]


def verified_lines(found: "Verified") -> list[str]:
    """What is wrong with the files of an array, each by name."""
    folder, n = found.manifest.directory, len(found.wrong)
    lines = [f"{folder / name}: {problem}" for name, problem in found.wrong]
    if found.unknown:
        lines.append(f"note: {found.unknown:,} files are whole, but have no checksum to compare them with")
    if not n:
        return [*lines, f"{found.files:,} files of {found.manifest.name} are whole"]
    advice = "`framearray verify --repair` renders them again"
    return [*lines, f"{n:,} of {found.files:,} files are missing or damaged; {advice}"]
