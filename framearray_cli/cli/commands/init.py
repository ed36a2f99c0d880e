"""`framearray init`."""

import re
import shlex
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from framearray_cli.base.units import counted

from ..options import Json, Quiet, choice, output_path, refusal, require_rendering, whole
from ..screen import Screen, err, print_result

if TYPE_CHECKING:
    from framearray_cli.starter.draft import Start

    from ..results import InitResult

MOST_PIXELS = 16384  # of a side, as in a job


class Resolution(NamedTuple):
    """Pixels."""

    width: int
    height: int


class SunPlace(NamedTuple):
    """Degrees north and east, and year-month-day."""

    latitude: float
    longitude: float
    date: str


def read_resolution(value: object) -> Resolution:
    """Read a size such as 640x480."""
    found = re.fullmatch(r"([0-9]{1,6})[xX*]([0-9]{1,6})", str(value).strip())
    if found is None or not all(1 <= int(side) <= MOST_PIXELS for side in found.groups()):
        raise refusal(f"width and height of 1 to {MOST_PIXELS} pixels, such as 640x480", value)
    return Resolution(int(found[1]), int(found[2]))


def read_sun(value: object) -> SunPlace:
    """Read a place and a day: 48.1,11.6,2026-06-21."""
    expected = "latitude, longitude and date, such as 48.1,11.6,2026-06-21"
    parts = [part.strip() for part in str(value).split(",")]
    try:
        latitude, longitude, day = float(parts[0]), float(parts[1]), date.fromisoformat(",".join(parts[2:]))
    except (ValueError, IndexError):
        raise refusal(expected, value) from None
    if not (-90 <= latitude <= 90 and -180 <= longitude <= 180):
        raise refusal("a latitude from -90 to 90 and a longitude from -180 to 180", value)
    return SunPlace(latitude, longitude, day.isoformat())


MOST = 1000  # frames or lights of a first job

SceneFile = Annotated[
    Path,
    typer.Argument(metavar="SCENE", help="Scene file: GLB, OBJ, STL, ..."),
]
CameraName = Annotated[
    str | None,
    typer.Option("--camera", help="Camera of the file; default: the first.", metavar="NAME"),
]
Resolutions = Annotated[
    Resolution | None,
    typer.Option(
        "--resolution",
        parser=read_resolution,
        help="Size of the images, pixels; default: 320x240, or the camera's shape.",
        metavar="WxH",
    ),
]
SunPlaces = Annotated[
    SunPlace | None,
    typer.Option(
        "--sun",
        parser=read_sun,
        help="The sun over a place on a day: 48.1,11.6,2026-06-21.",
        metavar="LAT,LON,DATE",
    ),
]
Formats = Annotated[
    str | None,
    typer.Option(
        "--format",
        help="Format of the images; default: png, or exr with --groups.",
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
    ),
]
Ups = Annotated[
    str | None,
    typer.Option("--up", help="Axis that points up; default: from the file, or detected.", **choice("y", "z")),
]
Lights = Annotated[
    int | None,
    typer.Option(
        "--lights",
        parser=whole(1, MOST),
        help="Light positions; default: from the file's animation, else 12.",
        metavar="N",
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
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Write a first job for a scene: camera, lights and exposure are found or chosen."""
    require_rendering()
    job_file = Path(f"{scene.stem or 'scene'}.toml") if target is None else output_path(target)
    with Screen(err, quiet=quiet) as screen:
        screen.wait("exploring the scene")
        from framearray_cli.starter import StartOptions, SunOption, offer_beside
        from framearray_cli.starter import init as run

        offer_beside()
        with screen.compiling():
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
    images = start.frames * start.light_frames
    size = f"{counted(start.frames, 'camera position')} x {counted(start.light_frames, 'light position')}"
    size += f" = {counted(images, 'image')}"
    lines = [f"{job_file}: {size}; next: framearray render {shlex.quote(str(job_file))}"]
    print_result(lines, _init_result(start, job_file, scene), quiet=quiet)


def _init_result(start: "Start", job_file: Path, scene: Path) -> "InitResult":
    from ..results import InitResult  # takes long to import

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
