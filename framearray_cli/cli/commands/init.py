"""`framearray init`."""

import shlex
from pathlib import Path
from typing import Annotated

import typer

from framearray_cli.base.units import counted

from ..completions import complete_camera, complete_scene
from ..options import DryRun, Json, Quiet, output_path, require_rendering
from ..screen import INIT_KERNELS, Screen, err, out, print_result, print_would, say
from ..streams import refuse_json
from ..values import choice, whole
from .init_values import Resolution, SunPlace, read_resolution, read_sun

MOST = 1000  # frames or lights of a first job

SceneFile = Annotated[
    Path,
    typer.Argument(
        metavar="SCENE", autocompletion=complete_scene, help="Scene file: GLB, OBJ, STL, ...", show_default=False
    ),
]
CameraName = Annotated[
    str | None,
    typer.Option(
        "--camera", help="Camera of the file; default: the first.", metavar="NAME", autocompletion=complete_camera
    ),
]
Resolutions = Annotated[
    Resolution | None,
    typer.Option(
        "--resolution",
        parser=read_resolution,
        help="Size of the images, pixels; default: 320x240, or the camera's shape.",
        metavar="WxH",
        show_default=False,
    ),
]
SunPlaces = Annotated[
    SunPlace | None,
    typer.Option(
        "--sun",
        parser=read_sun,
        help="The sun over a place on a day: 48.1,11.6,2026-06-21.",
        metavar="LAT,LON,DATE",
        show_default=False,
    ),
]
Formats = Annotated[
    str | None,
    typer.Option(
        "--format",
        help="Format of the images; default: png, or exr with --groups.",
        show_default=False,
        **choice("png", "exr", "tif", "jpg"),
    ),
]

Frames = Annotated[
    int | None,
    typer.Option(
        "--frames",
        parser=whole(1, MOST),
        help="Camera positions; default: from the file's animation, else 24.",
        metavar="N",
        show_default=False,
    ),
]
Ups = Annotated[
    str | None,
    typer.Option(
        "--up", help="Axis that points up; default: from the file, or detected.", show_default=False, **choice("y", "z")
    ),
]
Lights = Annotated[
    int | None,
    typer.Option(
        "--lights",
        parser=whole(1, MOST),
        help="Light positions; default: from the file's animation, else 12.",
        metavar="N",
        show_default=False,
    ),
]


def init(
    scene: SceneFile,
    target: Annotated[
        str | None,
        typer.Option("--output", "-o", help="Job file; default: the scene's name, here.", metavar="JOB"),
    ] = None,
    camera: CameraName = None,
    frames: Frames = None,
    lights: Lights = None,
    inside: Annotated[
        bool | None,
        typer.Option("--inside/--outside", help="Treat the scene as a room, or as an object; default: detected."),
    ] = None,
    up: Ups = None,
    resolution: Resolutions = None,
    image_format: Formats = None,
    groups: Annotated[bool, typer.Option("--groups", help="Store the light of every source separately.")] = False,
    sun: SunPlaces = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing job file.")] = False,
    dry_run: DryRun = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Write a first job for a scene: camera, lights and exposure are found or chosen."""
    require_rendering()
    job_file = Path(f"{scene.stem or 'scene'}.toml") if target is None else output_path(target)
    refuse_json(str(job_file))
    if dry_run:
        _print_planned(scene, job_file, force=force)
        return
    with Screen(err, quiet=quiet) as screen:
        screen.wait("exploring the scene")
        from framearray_cli.starter import STDOUT, StartOptions, SunOption, offer_beside, to_text
        from framearray_cli.starter import init as run

        offer_beside()
        with screen.compiling(INIT_KERNELS):
            options = StartOptions(
                camera=camera,
                frames=frames,
                lights=lights,
                inside=inside,
                up=up,  # type: ignore[arg-type]  # the parser of the option lets no other name through
                resolution=resolution,
                format=image_format,  # type: ignore[arg-type]  # the parser of the option lets no other name through
                groups=groups,
                sun=None if sun is None else SunOption(*sun),
            )
            start = run(scene, job_file, options, force=force)
        screen.say([*start.about, *(f"note: {note}" for note in start.notes)])
    if job_file == STDOUT:
        say(out, to_text(start, job_file).splitlines())
        return
    images = start.frames * start.light_frames
    size = f"{counted(start.frames, 'camera position')} x {counted(start.light_frames, 'light position')}"
    size += f" = {counted(images, 'image')}"
    lines = [f"{job_file}: {size}; next: framearray render {shlex.quote(str(job_file))}"]
    from ..describe import init_result

    print_result(lines, init_result(start, job_file, scene), quiet=quiet)


def _print_planned(scene: Path, job_file: Path, *, force: bool) -> None:
    """Print which files would be written or replaced."""
    from framearray_cli.starter import planned_files

    files = planned_files(scene, job_file, force=force)
    lines = [f"would {'replace' if file.exists() else 'write'} {file}" for file in files]
    print_would(lines or ["would print the job"])
