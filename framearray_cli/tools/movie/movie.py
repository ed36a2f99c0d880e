"""Assemble a movie, or a numbered image sequence, along a path; all input is the manifest and the images it names.

Images of a sequence that need no change become hard links.
"""

import os
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import partial
from itertools import count, groupby
from pathlib import Path
from typing import Any, Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray

from framearray_cli.array.cryptomatte import ATTRIBUTES
from framearray_cli.array.exr import Attribute
from framearray_cli.array.images import (
    COLOUR_ID,
    FOR_SCREENS,
    POSITION_ORIGIN,
    SCENE_LIGHT,
    Extension,
    ImageFormat,
    format_name,
    link_or_copy,
    read_image,
    read_layers,
    resized,
    unassociated,
    write_codes,
    write_image,
    write_layers,
)
from framearray_cli.array.integrity import REMEDY, list_present
from framearray_cli.array.manifest import Manifest, layers_path
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.array.mixtures import position_text
from framearray_cli.array.pictures import Pictures, Relight, picture_attributes
from framearray_cli.array.places import brief_frames_text
from framearray_cli.base.arrays import Float32, Image
from framearray_cli.base.errors import JobError, OutputError
from framearray_cli.base.files import folder_for, reason, require_new, temporary_folder
from framearray_cli.base.forms.table import changed
from framearray_cli.base.openimage import read_texts
from framearray_cli.base.units import agree, counted

from .. import AssembleResult, Progress
from ..drawing import SMALLEST, typeface
from ..mixing import SumOptions
from .look import Look, look_warnings, picture_warnings, screen_codes, shot_label, shot_text
from .pathfile import Mode, Sweep, load_movie_path, sweep_path
from .timeline import Shot, Timeline, array_problems, make_timeline, mix_timeline
from .video import ANIMATIONS, VIDEOS, require_encoder, write_animation, write_video

Say: TypeAlias = Callable[[str], None]
MOVIES = (*VIDEOS, *ANIMATIONS)
LIGHT = "light_"  # begins the names of layers with the light of groups


@dataclass(frozen=True, slots=True, kw_only=True)
class MovieOptions:
    """The look and the content of a movie or sequence.

    Attributes:
        look: of movies, PNG and JPEG.
        fps: frames per second; None: from the path or the array.
        positions: "nearest" or "blend"; None: from the path.
        sums: pictures as sums of light positions; none: from the path.
        layered: write EXR with the light of each group and the layers of the array next to each picture.
    """

    look: Look = field(default_factory=Look)
    fps: float | None = None
    positions: Mode | None = None
    sums: SumOptions = field(default_factory=SumOptions)
    layered: bool = False


def assemble_movie(
    out: Path,
    path: Path | Sweep,
    target: Path,
    options: MovieOptions,
    *,
    progress: Progress = lambda done, total: None,
    warned: Callable[[Sequence[str]], None] = lambda warnings: None,
    note: Say = lambda text: None,
    force: bool = True,
) -> AssembleResult:
    """Assemble a movie, an image sequence or a still from a frame array; it appears whole or not at all.

    Args:
        out: output folder of a render, or its manifest.
        path: TOML file of segments, see docs/guide/movies.md; or a sweep.
        target: "x.mp4" or another of MOVIES; "x.####.png" (also .exr, .tif, .jpg), where each "#" is a digit; a name
            without suffix is a folder for "frame.####" in the array's own format; of a still "x.png".
        progress: called as each frame is composed.
        warned: called once, before the first frame, with the warnings of a useless movie; may raise an error.
        note: called with each remark that is no warning.
        force: replace an earlier movie or still, or an earlier sequence that is no longer.

    Raises:
        JobError: the path is broken, or names places that the array lacks.
        OutputError: an image is missing or damaged, or the target cannot be written.
        MissingExtraError: PyAV is needed and not installed, or an encoder or typeface is missing.
    """
    manifest, look = read_manifest(out), options.look
    left_out: list[str] = []
    line = _plan(path, manifest, options, left_out.append, note)
    pictures = Pictures(manifest)
    suffix, is_still = target.suffix.lower(), isinstance(path, Sweep) and path.still
    is_movie = suffix in MOVIES and not is_still
    if is_still:
        look = replace(look, size=_still_size(manifest, look))
    if not is_movie:
        target = _sequence_target(target, manifest, look)
    if options.layered:
        _check_layers(target, manifest, line)
    if is_movie or is_still:
        require_new(target, force=force)
    if is_movie:
        require_encoder(suffix)
        if len(line.shots) == 1:
            note(f"{target}: one frame; framearray still makes a picture")
    elif not is_still:
        _check_earlier(target, len(line.shots), force=force)
    _check_images(pictures, line)
    levels = picture_warnings(pictures, line, look) if is_movie or format_name(target) in FOR_SCREENS else ()
    warned([*left_out, *look_warnings(manifest, look), *levels])
    write = _write_movie if is_movie else partial(_write_sequence, layered=options.layered)
    write(pictures, line, target, look, progress)
    where, n_images = target if is_movie or is_still else target.parent, len(set(line.shots))
    n_frames, size = len(line.shots), look.size or manifest.resolution
    return AssembleResult(path=str(where), frames=n_frames, images=n_images, fps=float(line.fps), size=size)


def _plan(path: Path | Sweep, manifest: Manifest, options: MovieOptions, warn: Say, note: Say) -> Timeline:
    """Read the path, with options instead of its own values, find the content of each frame, and check labels."""
    if isinstance(path, Sweep):
        source: Path | str = path.kind or "--cameras"
        movie = sweep_path(path, manifest, note)
    else:
        source, movie = path, load_movie_path(path, partial(array_problems, manifest=manifest))
    updates = {"fps": options.fps, "positions": options.positions}
    movie = changed(movie, **{key: value for key, value in updates.items() if value is not None})
    line = make_timeline(source, movie, manifest)
    line = mix_timeline(source, movie, manifest, line, options.sums, warn)
    if options.look.label:
        typeface(SMALLEST)
        for shot in dict.fromkeys(line.shots):
            shot_text(manifest, shot, options.look.text)
    return line


def _sequence_target(target: Path, manifest: Manifest, look: Look) -> Path:
    """Return the pattern of a sequence, a path whose name has one run of "#"; in a folder in the array's own format.

    Raises:
        OutputError: it is no pattern, lies in the folder of the array, or its format cannot have this look.
    """
    if not look.size and (not target.suffix or os.path.isdir(target)):
        target = target / f"frame.####{Path(manifest.parts[0].images).suffix}"
    elif format_name(target) not in get_args(Extension):
        images = ", ".join(f".{name}" for name in get_args(Extension))
        kinds = images if look.size else f"{', '.join(MOVIES)} (a movie), {images} (numbered images) or a folder"
        raise OutputError(f"{target}: expected {kinds}")
    elif len(re.findall("#+", target.name)) != (0 if look.size else 1):
        name = 'without "#"' if look.size else 'with "####" where the frame number goes, as in frame.####.png'
        raise OutputError(f"{target}: expected a name {name}")
    if os.path.realpath(target.parent) == os.path.realpath(manifest.directory):
        raise OutputError(f"{target.parent}: holds the frame array itself; choose another folder")
    if look.changes and format_name(target) not in FOR_SCREENS:
        raise OutputError(
            f"{target}: {look.changes[0]} changes only movies, PNG and JPEG; {target.suffix} keeps the radiance"
        )
    return target


def _still_size(manifest: Manifest, look: Look) -> tuple[int, int]:
    """Return the size of a still; refuse one of another shape than the images."""
    width, height = manifest.resolution
    wide, high = size = look.size or manifest.resolution
    if abs(wide * height - high * width) > max(width, height):
        like = f"{wide}x{max(1, round(wide * height / width))}"
        raise JobError("--size", [f"expected the shape of the images, {width}x{height}, as {like}, got {wide}x{high}"])
    return size


def _check_images(pictures: Pictures, line: Timeline) -> None:
    """Check that every image is there before using the first, so that missing ones are reported at once."""
    manifest, present = pictures.manifest, list_present(pictures.manifest)
    wanted: dict[Path, Shot] = {}
    for shot in dict.fromkeys(line.shots):
        wanted.update(dict.fromkeys(pictures.files(shot.c, shot.positions), shot))
    missing = sorted(path for path in wanted if not present.has([path]))
    if missing:
        shot, cameras = wanted[missing[0]], {wanted[path].c for path in missing}
        lights = zip(manifest.axes, shot.positions, strict=True)
        place = ", ".join([f"camera {shot.c}", *(f"{axis} {position_text(position)}" for axis, position in lights)])
        gone = f"{len(missing):,} of the {counted(len(wanted), 'image')} on the path {agree(len(missing), 'is', 'are')}"
        whose = f"{agree(len(cameras), 'camera', 'cameras')} {brief_frames_text(cameras)}"
        raise OutputError(
            f"{manifest.directory}: {gone} missing, of {whose}; the first is {missing[0].name} ({place}); {REMEDY}"
        )


def _write_movie(pictures: Pictures, line: Timeline, target: Path, look: Look, report: Progress) -> None:
    (width, height), suffix = pictures.manifest.resolution, target.suffix.lower()
    frames = _frame_codes(pictures, line, look, VIDEOS[suffix].bits if suffix in VIDEOS else 8, report)
    with folder_for(target.parent):
        if suffix in ANIMATIONS:
            write_animation(target, frames, width, height, line.fps, len(line.shots))
        else:
            write_video(target, frames, width, height, line.fps)


def _frame_codes(
    pictures: Pictures, line: Timeline, look: Look, bits: Literal[8, 16], report: Progress
) -> Iterator[NDArray[Any]]:
    """Compose the codes of each frame; a held picture is composed once, and is the same array each time."""
    numbers = count(1)
    for (shot, relight), held in groupby(zip(line.shots, line.relights, strict=True)):
        image = pictures.picture(shot.c, shot.positions, relight)
        codes = screen_codes(image, look, shot_text(pictures.manifest, shot, look.text), bits)
        for _ in held:
            report(next(numbers), len(line.shots))
            yield codes


def write_frame(
    pictures: Pictures, shot: Shot, relight: Relight, target: Path, fps: Fraction, look: Look, *, layered: bool = False
) -> None:
    """Link one image, or compose and convert it if format, light or look differ.

    Args:
        layered: write an EXR with the light of each group and the layers of the array.
    """
    size = None if look.size == pictures.manifest.resolution else look.size
    source = pictures.whole_file(shot.c, shot.positions, relight)
    if source is not None and format_name(source) == format_name(target) and not (look.changes or layered or size):
        read_image(source)  # a damaged image must not slip into the sequence
        link_or_copy(source, target, copy=look.size is not None)  # a still may be edited
        return
    image, alpha = pictures.picture(shot.c, shot.positions, relight), pictures.alpha(shot.c)
    if size:
        image, alpha = resized(image, size), None if alpha is None else np.minimum(resized(alpha, size), 1)
    extension: Extension = format_name(target)  # type: ignore[assignment]  # checked by `_sequence_target`
    attributes = _attributes(pictures.manifest, shot, fps) | ({COLOUR_ID: SCENE_LIGHT} if extension == "exr" else {})
    if layered:
        _write_layered(pictures, shot, relight, image, alpha, target, attributes)
    elif format_name(target) in FOR_SCREENS:
        text = shot_text(pictures.manifest, shot, look.text) if look.label else ""
        if alpha is None or extension != "png" or look.label:  # a label is no part of the scene
            codes = screen_codes(image, look, text)
        else:
            shown, covered = unassociated(image, alpha)
            codes = np.dstack([screen_codes(shown, look, text), covered])
        write_codes(target, codes, ImageFormat(format=extension), attributes)
    else:
        more = pictures.differences(shot.c, shot.positions, relight) if extension == "exr" else None
        if more and size:
            more = {name: resized(part, size) for name, part in more.items()}
        write_image(target, np.ascontiguousarray(image), ImageFormat(format=extension), attributes, more, alpha)


def _write_layered(
    pictures: Pictures,
    shot: Shot,
    relight: Relight,
    image: Image,
    alpha: Float32 | None,
    target: Path,
    attributes: dict[str, Attribute],
) -> None:
    """Write a picture, the light of each group that it is the sum of, and all layers of its camera into one EXR."""
    manifest, channels = pictures.manifest, _rgb("", image)
    if alpha is not None:
        channels["A"] = alpha
    for name, part in pictures.parts(shot.c, shot.positions, relight).items():
        channels |= _rgb(LIGHT + re.sub(r"\W", "_", name) + ".", part)
    for name, part in pictures.differences(shot.c, shot.positions, relight).items():
        channels |= _rgb(f"{name}.", part)
    if manifest.layers:
        path = layers_path(manifest, shot.c)
        channels |= read_layers(path)
        attributes |= read_texts(path, (ATTRIBUTES, POSITION_ORIGIN))
    write_layers(target, channels, attributes)


def _rgb(prefix: str, image: Image) -> dict[str, Float32]:
    return {f"{prefix}{letter}": image[..., k] for k, letter in enumerate("RGB")}


def _attributes(manifest: Manifest, shot: Shot, fps: Fraction) -> dict[str, Attribute]:
    match shot.positions:
        case (int() | float() as position,) if position == int(position):
            return picture_attributes(manifest, shot.c, int(position), fps)
    return picture_attributes(manifest, shot.c, None, fps) | {"framearray:place": shot_label(manifest, shot)}


def _check_layers(pattern: Path, manifest: Manifest, line: Timeline) -> None:
    """Refuse layers in a format that has no room for them, and of an array or camera that lacks them."""
    if format_name(pattern) != "exr":
        raise OutputError(f"{pattern}: expected frame.####.exr with --layers; no other format holds layers")
    if not manifest.layers and not manifest.groups:
        where = f"{manifest.directory}: expected layers or groups of lights for --layers, found neither"
        raise OutputError(f"{where}; render again with output.layers = true")
    wanted = sorted({layers_path(manifest, shot.c) for shot in line.shots}) if manifest.layers else []
    missing = [path for path in wanted if not os.path.isfile(path)]
    if missing:
        gone = (
            f"{len(missing):,} of {counted(len(wanted), 'file')} of layers {agree(len(missing), 'is', 'are')} missing"
        )
        raise OutputError(f"{manifest.directory}: {gone}; the first is {missing[0].name}; {REMEDY}")


def _write_sequence(
    pictures: Pictures, line: Timeline, pattern: Path, look: Look, report: Progress, *, layered: bool = False
) -> None:
    """Write all frames into a temporary folder inside the target folder, then move them out of it."""
    before, names = pattern.name.partition("#")[0], _names(pattern, len(line.shots))
    try:
        with folder_for(pattern.parent), temporary_folder(pattern.parent, before) as part:
            last: tuple[Shot, Relight, Path] | None = None
            for k, (name, shot, relight) in enumerate(zip(names, line.shots, line.relights, strict=True)):
                if last is not None and last[:2] == (shot, relight):  # a held picture is composed once
                    link_or_copy(last[2], part / name)
                else:
                    write_frame(pictures, shot, relight, part / name, line.fps, look, layered=layered)
                    last = (shot, relight, part / name)
                report(k + 1, len(names))
            _move(names, part, pattern.parent)
    except OSError as error:
        raise OutputError(f"{pattern}: cannot be written: {reason(error)}") from error


def _names(pattern: Path, n: int) -> list[str]:
    """Return the names of n frames; a still keeps its own."""
    if "#" not in pattern.name:
        return [pattern.name]
    before, digits, after = re.split("(#+)", pattern.name)
    return [f"{before}{k:0{len(digits)}d}{after}" for k in range(n)]


def _check_earlier(pattern: Path, n: int, *, force: bool) -> None:
    """Refuse an earlier sequence of that name; with `force` only one that n frames would not replace whole."""
    folder, names = pattern.parent, set(_names(pattern, n))
    before, _, after = re.split("(#+)", pattern.name)
    number = re.compile(re.escape(before) + r"\d+" + re.escape(after))
    entries = sorted(entry.name for entry in folder.iterdir()) if os.path.isdir(folder) else []
    found = [name for name in entries if number.fullmatch(name)]
    if left := [name for name in found if name not in names]:
        kept = f"{counted(len(left), 'file')} that this one would not replace"
        raise OutputError(
            f"{folder / left[0]}: belongs to an earlier sequence, with {kept}; delete them or choose another name"
        )
    if found and not force:
        kept = f"{counted(len(found), 'file')} of an earlier sequence"
        remedy = "give another name with --output, or --force to replace them"
        raise OutputError(f"{folder / found[0]}: is there already, with {kept}; {remedy}")


def _move(names: Sequence[str], part: Path, folder: Path) -> None:
    """Move all frames; an interrupt takes effect once all are moved, a few milliseconds later.

    The folder may have other files, so no single rename can replace it. If the system refuses to move a frame, those
    moved before stay.
    """
    try:
        for name in names:
            (part / name).replace(folder / name)
    except OSError:
        raise
    except BaseException:
        for name in names:
            with suppress(FileNotFoundError):  # moved before the interrupt
                (part / name).replace(folder / name)
        raise
