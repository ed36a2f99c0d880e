"""`framearray init`."""

import re
import shlex
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from framearray_cli.base.forms.toml import require_scene
from framearray_cli.base.units import FARTHEST, counted

from .. import options as opt
from ..screen import Screen, err, print_result

if TYPE_CHECKING:
    from framearray_cli.starter.draft import SunOption

MOST_PIXELS = 16384  # of a side, as in a job
TURN_DEG = 360


def read_resolution(value: object) -> tuple[int, int]:
    """Read width and height in pixels, such as 640x480."""
    found = re.fullmatch(r"([0-9]{1,6})[xX*]([0-9]{1,6})", str(value).strip())
    if found is None or not all(1 <= int(side) <= MOST_PIXELS for side in found.groups()):
        raise opt.refusal(f"width and height of 1 to {MOST_PIXELS} pixels, such as 640x480", value)
    return int(found[1]), int(found[2])


def read_sun(value: object) -> "SunOption":
    """Read a place and one or more days: 48.1,11.6,2026-06-21."""
    from framearray_cli.starter.draft import SunOption

    expected = "latitude, longitude and one or more dates, such as 48.1,11.6,2026-06-21"
    parts = [part.strip() for part in str(value).split(",")]
    try:
        latitude, longitude = map(float, parts[:2])
        days = tuple(map(date.fromisoformat, parts[2:]))
    except ValueError:
        days = ()
    if not days:
        raise opt.refusal(expected, value)
    if not (-90 <= latitude <= 90 and -180 <= longitude <= 180):
        raise opt.refusal("a latitude from -90 to 90 and a longitude from -180 to 180", value)
    if len(set(days)) < len(days):
        raise opt.refusal("different dates", value)
    return SunOption(latitude, longitude, days)


def read_north(value: object) -> float | tuple[float, ...]:
    """Read degrees, or a direction of the scene: 0,0,-1."""
    try:
        found = tuple(float(part) for part in str(value).split(","))
    except ValueError:
        found = ()
    if len(found) == 1 and abs(found[0]) <= TURN_DEG:
        return found[0]
    if len(found) != 3 or not 0 < sum(abs(part) for part in found) < FARTHEST:
        raise opt.refusal(f"degrees from -{TURN_DEG} to {TURN_DEG}, or a direction of the scene such as 0,0,-1", value)
    return found


COUNT = opt.whole(1, 1000)  # frames or lights of a first job
MINUTES = opt.number(1, 24 * 60)

Target = Annotated[str | None, opt.option("--output -o", "Job file; default: the scene's name, here.", "JOB")]
FRAMES = "Camera positions; default: from the file's animation, else 24."
LIGHTS = "Light positions, on all days of --sun together; default: from the file's animation, else 12 per day."
INSIDE = "Treat the scene as a room, or as an object; default: detected."
ROOM = "Room or storey to stand in, of an IFC file; part of its name is enough."
UP = "Axis that points up; default: from the file, or detected."
SIZE = "Size of the images, pixels; default: 320x240, or the camera's shape."
FORMAT = "Format of the images; default: png, or exr with --groups."
Format = Annotated[
    Literal["png", "exr", "tif", "jpg"] | None, opt.option("--format", FORMAT, **opt.choice("png", "exr", "tif", "jpg"))
]
SUN = "The sun over a place on one or more days: 48.1,11.6,2026-06-21,2026-12-21."
NORTH = "North with --sun: a direction, or degrees clockwise from the default: 0,0,-1, or 0,1,0 if z points up."
STEP = "Minutes between positions of --sun, instead of --lights."


def init(
    scene: Annotated[Path, typer.Argument(metavar="SCENE", help="Scene file: GLB, OBJ, STL, ...")],
    target: Target = None,
    folders: opt.Folders = None,
    camera: Annotated[str | None, opt.option("--camera", "Camera of the file; default: the first.", "NAME")] = None,
    frames: Annotated[int | None, opt.option("--frames", FRAMES, "N", COUNT)] = None,
    lights: Annotated[int | None, opt.option("--lights", LIGHTS, "N", COUNT)] = None,
    inside: Annotated[bool | None, opt.option("--inside/--outside", INSIDE)] = None,
    room: Annotated[str | None, opt.option("--room", ROOM, "NAME")] = None,
    up: Annotated[Literal["y", "z"] | None, opt.option("--up", UP, **opt.choice("y", "z"))] = None,
    # Any: these parsers return a tuple each, for which the command line would take several words.
    resolution: Annotated[Any, opt.option("--resolution", SIZE, "WxH", read_resolution)] = None,
    image_format: Format = None,
    groups: Annotated[bool, opt.option("--groups", "Store the light of every source separately.")] = False,
    sun: Annotated[Any, opt.option("--sun", SUN, "LAT,LON,DATE,...", read_sun)] = None,
    north: Annotated[Any, opt.option("--north", NORTH, "DEGREES/X,Y,Z", read_north)] = None,
    step: Annotated[float | None, opt.option("--step", STEP, "MINUTES", MINUTES)] = None,
    force: Annotated[bool, opt.option("--force", "Replace an existing job file.")] = False,
    quiet: opt.Quiet = False,
    json: opt.Json = False,
) -> None:
    """Write a first job for a scene: camera, lights and exposure are found or chosen."""
    opt.refuse({"--outside": inside is False and room is not None}, "does not go with --room")
    opt.refuse({"--north": sun is None and north is not None, "--step": sun is None and step}, "needs --sun")
    opt.refuse({"--step": lights and step}, "does not go with --lights")
    job_file = Path(f"{scene.stem or 'scene'}.toml") if target is None else opt.output_path(target)
    require_scene(scene)
    opt.require_rendering()
    with Screen(err, quiet=quiet) as screen:
        screen.wait("exploring the scene")
        from framearray_cli.starter import StartOptions, offer_beside
        from framearray_cli.starter import init as run

        offer_beside()
        with screen.compiling():
            options = StartOptions(
                camera=camera, frames=frames, lights=lights, inside=inside, room=room, up=up, resolution=resolution,
                format=image_format, groups=groups, folders=tuple(folders or ()),
                sun=sun._replace(north=north, step=step) if sun else None,
            )  # fmt: skip
            start = run(scene, job_file, options, force=force)
        screen.say([*start.about, *(f"note: {note}" for note in start.notes)])
    images = start.frames * start.light_frames
    size = f"{counted(start.frames, 'camera position')} x {counted(start.light_frames, 'light position')}"
    size += f" = {counted(images, 'image')}"
    lines = [f"{job_file}: {size}; next: framearray render {shlex.quote(str(job_file))}"]
    from ..results import InitResult  # takes long to import

    result = InitResult(
        job=str(job_file), scene=str(scene), cameras=start.frames, lights=start.light_frames, images=images,
        inside=start.inside, about=start.about, notes=start.notes,
    )  # fmt: skip
    print_result(lines, result, quiet=quiet)
