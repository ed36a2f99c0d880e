"""Results of commands as the typed data that `--json` prints."""

from pathlib import Path
from typing import TYPE_CHECKING

from framearray_cli.engine.embree.library import packet_width

from .results import (
    AmbientLight,
    ArraySize,
    CheckResult,
    DamagedFile,
    GroupSize,
    InitResult,
    RenderResult,
    SceneCounts,
    StudyDay,
    UnfinishedCamera,
    VerifyResult,
)

if TYPE_CHECKING:
    from framearray_cli.array.integrity import Verification
    from framearray_cli.job.job import Job
    from framearray_cli.render.estimate import Estimate
    from framearray_cli.render.prepare import Prepared
    from framearray_cli.render.summary import Summary
    from framearray_cli.starter.model import Start


def check_result(estimate: "Estimate") -> CheckResult:
    """Describe what `check` found."""
    from framearray_cli.render.progress import ambient_figures

    prepared, figures = estimate.prepared, ambient_figures(estimate.ambient)
    report = prepared.scene.report
    return CheckResult(
        name=prepared.job.name,
        directory=str(prepared.job.output.directory),
        scene=SceneCounts(
            file=str(prepared.job.scene.file),
            triangles=report.triangles,
            materials=report.materials,
            textures=report.textures,
            dropped=dict(report.dropped),
        ),
        array=_array_size(prepared),
        ambient=AmbientLight(
            lowest=float(figures.lowest),
            highest=float(figures.highest),
            error=float(figures.error),
            paths=figures.paths,
        ),
        automatic=estimate.settings.table() if estimate.settings else None,
        target=estimate.target.table() if estimate.target else None,
        memory_bytes=int(estimate.memory),
        free_memory_bytes=int(estimate.available),
        blocks=estimate.blocks,
        disk_bytes=int(estimate.disk),
        free_disk_bytes=int(estimate.free),
        seconds=float(estimate.seconds),
        rays_together=packet_width(),
    )


def _array_size(prepared: "Prepared") -> ArraySize:
    from framearray_cli.array.moments import day_spans

    return ArraySize(
        cameras=prepared.n_cameras,
        images_per_camera=prepared.n_lights,
        images=prepared.n_cameras * prepared.n_lights,
        resolution=prepared.job.camera.resolution,
        groups=tuple(GroupSize(name=one.name, positions=len(one.positions)) for one in prepared.lights.groups),
        days=tuple(
            StudyDay(axis=axis, first=day.first, last=day.last, start=day.start.isoformat(), stop=day.stop.isoformat())
            for axis, moments in prepared.job.light.moments.items()
            for day in day_spans(moments)
        ),
    )


def render_result(summary: "Summary", job: "Job", compile_seconds: float) -> RenderResult:
    """Describe what a render did, some of its time by compiling."""
    from framearray_cli.array.manifest import FILE_NAME

    folder = job.output.directory
    clipped, black = summary.shares or (None, None)
    return RenderResult(
        directory=str(folder),
        manifest=str(folder / FILE_NAME),
        finished=summary.there == summary.total,
        written=summary.images,
        there=summary.there,
        images=summary.total,
        seconds=float(summary.seconds),
        compile_seconds=float(compile_seconds),
        array_seconds=float(summary.all_seconds),
        stage_seconds={stage: float(seconds) for stage, seconds in summary.stages.items()},
        clipped=clipped,
        black=black,
        rays_per_pixel_image={kind: float(n) for kind, n in summary.rays_per_pixel_image.items()},
        hits_per_pixel=float(summary.hits),
        peak_memory_bytes=int(summary.peak_memory),
        standard_error=summary.standard_error or None,
    )


def verify_result(found: "Verification", repaired: RenderResult | None = None) -> VerifyResult:
    """Describe what `verify` found."""
    return VerifyResult(
        directory=str(found.manifest.directory),
        name=found.manifest.name,
        whole=found.whole,
        files=found.files,
        unknown=found.unknown,
        mixed_cells=bool(found.mixed_cells),
        damaged=tuple(DamagedFile(file=name, problem=problem) for name, problem in found.damaged),
        unfinished=tuple(UnfinishedCamera(camera=c, files=n) for c, n in found.unfinished().items()),
        repaired=repaired,
    )


def init_result(start: "Start", job_file: Path, scene: Path) -> InitResult:
    """Describe the job that `init` wrote."""
    return InitResult(
        job=str(job_file),
        scene=str(scene),
        cameras=start.frames,
        lights=start.light_frames,
        images=start.frames * start.light_frames,
        inside=start.inside,
        about=tuple(start.about),
        notes=start.notes,
    )
