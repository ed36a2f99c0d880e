"""`framearray init`."""

import shlex
from pathlib import Path
from typing import Annotated

import typer

from ..describe import init_result
from ..options import Json, Quiet, output_path
from ..screen import Screen, err, print_result
from ..values import whole

MOST = 1000  # frames or lights of a first job


def init(
    scene: Annotated[Path, typer.Argument(metavar="SCENE", help="Scene file: GLB, OBJ, STL, ...", show_default=False)],
    target: Annotated[
        str | None,
        typer.Option("--output", "-o", help="Job file; default: the scene's name, here.", metavar="JOB"),
    ] = None,
    camera: Annotated[
        str | None, typer.Option("--camera", help="Which camera of the file; default: the first.", metavar="NAME")
    ] = None,
    frames: Annotated[
        int | None,
        typer.Option("--frames", parser=whole(1, MOST), help="Frames of the camera.", metavar="N", show_default=False),
    ] = None,
    lights: Annotated[
        int | None,
        typer.Option(
            "--lights", parser=whole(1, MOST), help="Positions of the light.", metavar="N", show_default=False
        ),
    ] = None,
    inside: Annotated[
        bool | None,
        typer.Option("--inside/--outside", help="Treat the scene as a room, or as an object to look at."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing job file.")] = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Write a first job for a scene: camera, lights and exposure are found or chosen."""
    job_file = Path(f"{scene.stem or 'scene'}.toml") if target is None else output_path(target)
    with Screen(err, quiet=quiet) as screen:
        screen.wait("exploring the scene")
        from framearray_cli.starter import StartOptions
        from framearray_cli.starter import init as run

        with screen.compiling():
            options = StartOptions(camera=camera, frames=frames, lights=lights, inside=inside)
            start = run(scene, job_file, options, force=force)
        screen.say(start.about)
    images = start.camera.frames * start.light_frames
    size = f"{start.camera.frames} eyes x {start.light_frames} lights = {images} images"
    lines = [f"{job_file}: {size}; next: framearray render {shlex.quote(str(job_file))}"]
    print_result(lines, init_result(start, job_file, scene), quiet=quiet)
