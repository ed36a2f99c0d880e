"""`framearray export`."""

from typing import Annotated, Literal

from framearray_cli.array.places import ALL_PLACES
from framearray_cli.base.units import counted
from framearray_cli.tools.export import EXPORT_KINDS

from .. import options as opt
from ..screen import Screen, err, print_result

KINDS = f"Purpose: {', '.join(EXPORT_KINDS[:-1])} or {EXPORT_KINDS[-1]}."
SETS = "Sets: 80/10/10 (train/val/test), light=90/10, test=0-lastx8; may be repeated; see guide/export.md."
PicturesFormat = Annotated[
    Literal["png", "jpg", "exr", "tif"],
    opt.option("--image-format", "Format of the pictures.", **opt.choice("png", "jpg", "exr", "tif")),
]
Points = Annotated[int, opt.option("--points", "Maximum number of points of the scene.", "N", opt.whole(0))]


def export(
    array: opt.ArrayFolder,
    kind: Annotated[str, opt.option("--format -f", KINDS, **opt.choice(*EXPORT_KINDS))],
    target: Annotated[str, opt.option("--output -o", "Folder of the export.", "FOLDER")],
    cameras: opt.Cameras = None,
    light: opt.Light = None,
    at: opt.At = None,
    group: Annotated[str | None, opt.option("--group", "Only the light of this group of sources.", "NAME")] = None,
    split: Annotated[list[str] | None, opt.option("--split", SETS, "RULE")] = None,
    seed: Annotated[int, opt.option("--split-seed", "Random seed for --split.", "N", opt.whole(0))] = 0,
    image_format: PicturesFormat = "png",
    exposure: opt.Exposure = 0.0,
    points: Points = 10_000,
    environment: opt.Environment = None,
    rotate: opt.Rotate = None,
    soft: opt.Soft = None,
    copy: Annotated[bool, opt.option("--copy", "Copy images that could be hard links.")] = False,
    force: Annotated[bool, opt.option("--force", "Replace an earlier export.")] = False,
    quiet: opt.Quiet = False,
    json: opt.Json = False,
) -> None:
    """Export a frame array for other tools: images with cameras, lights, depth and points."""
    from framearray_cli.array.images import FOR_SCREENS, ImageFormat
    from framearray_cli.tools.export.write import ExportOptions, export_array

    opt.refuse({"--exposure": exposure and image_format not in FOR_SCREENS}, "changes only PNG and JPEG")
    with Screen(err, quiet=quiet) as screen:
        options = ExportOptions(
            kind=kind, cameras=ALL_PLACES if cameras is None else cameras, light=light, at=at or (), group=group,
            image_format=ImageFormat(format=image_format, exposure=exposure), points=points,
            sums=opt.sum_options(environment, rotate, soft), copy=copy, split=tuple(split or ()), seed=seed,
        )  # fmt: skip
        progress = screen.counter("exporting", "image")
        made, notes, warnings = export_array(array, opt.output_path(target), options, force=force, progress=progress)
        screen.end()
        screen.say(f"warning: {warning}" for warning in warnings)
    size = f"{counted(made.cameras, 'camera position')} x {counted(made.lights, 'light position')}"
    if made.sets:
        size += f", {', '.join(f'{n:,} {name}' for name, n in made.sets.items())}"
    size += f", {counted(made.points, 'point')}" if made.points else ""
    print_result([f"{made.directory}: {size}", *(f"note: {note}" for note in notes)], made, quiet=quiet)
