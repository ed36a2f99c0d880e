"""Assemble a movie, or a numbered image sequence, along a path; all input is the manifest and the images it names."""

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any, Protocol, cast

from numpy.typing import NDArray

from framearray_cli.array.images import FOR_SCREENS, Extension, check_image, format_name, require_writer
from framearray_cli.array.integrity import REMEDY, list_present
from framearray_cli.array.manifest import Manifest
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.array.mixtures import position_text
from framearray_cli.array.pictures import Pictures, Relight
from framearray_cli.array.places import brief_frames_text
from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import folder_for, require_new
from framearray_cli.base.forms.table import changed
from framearray_cli.base.units import agree, counted

from .. import Progress
from ..drawing import SMALLEST, typeface
from ..mixing import SumOptions
from .animation import ANIMATIONS, open_animation, require_animation
from .look import Look, look_warnings, path_warnings, picture_warnings, screen_codes, shot_label
from .pathfile import Mode, MoviePath, Sweep, load_movie_path, sweep_path
from .sequence import (
    check_earlier,
    check_layers,
    check_look,
    check_otio,
    otio_file,
    sequence_pattern,
    write_otio,
    write_sequence,
)
from .timeline import Shot, Timeline, array_problems, make_timeline, mix_timeline
from .video import VIDEOS, open_video, require_encoder

MOVIES = (*VIDEOS, *ANIMATIONS)


@dataclass(frozen=True, slots=True, kw_only=True)
class MovieOptions:
    """The look and the content of a movie or sequence.

    Attributes:
        look: of movies, PNG and JPEG.
        fps: frames per second; None: from the path or the array.
        positions: "nearest" or "blend"; None: from the path.
        sums: pictures as sums of light positions; none: from the path.
        otio: describe the sequence for editing programs, in a file next to it.
        layered: write EXR with the light of each group and the layers of the array next to each picture.
    """

    look: Look = field(default_factory=Look)
    fps: float | None = None
    positions: Mode | None = None
    sums: SumOptions = field(default_factory=SumOptions)
    otio: bool = False
    layered: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class MovieSummary:
    """The content of a finished movie or sequence.

    Attributes:
        target: the movie, or the folder of the sequence.
        n_frames: frames in it.
        n_images: the number of different places in the array among them.
        fps: frames per second.
        otio: the file that describes the sequence for editing programs, if requested.
    """

    target: Path
    n_frames: int
    n_images: int
    fps: Fraction
    otio: Path | None = None


def assemble_movie(
    out: Path,
    path: Path | Sweep,
    target: Path,
    options: MovieOptions,
    *,
    progress: Progress = lambda done, total: None,
    warned: Callable[[Sequence[str]], None] = lambda warnings: None,
    force: bool = True,
    dry_run: bool = False,
) -> MovieSummary:
    """Assemble a movie or an image sequence from a frame array; it appears whole or not at all.

    Args:
        out: output folder of a render, or its manifest.
        path: TOML file of segments, see docs/guide/movies.md; or a sweep.
        target: "x.mp4" or another of MOVIES; "x.####.png" (also .exr, .tif, .jpg), where each "#" is a digit; a name
            without suffix is a folder for "frame.####" in the array's own format.
        progress: called after each frame.
        warned: called once, before the first frame, with the warnings of a useless movie; may raise an error.
        force: replace an earlier movie, or an earlier sequence that is no longer.
        dry_run: check everything, and write nothing.

    Raises:
        JobError: the path is broken, or names places that the array lacks.
        OutputError: an image is missing or damaged, or the target cannot be written.
        MissingExtraError: PyAV or OpenTimelineIO is needed and not installed, or an encoder or typeface is missing.
    """
    manifest, look = read_manifest(out), options.look
    left_out: list[str] = []
    movie, line = _plan(path, manifest, options, left_out.append)
    pictures = Pictures(manifest)
    if look.label:
        typeface(SMALLEST)
    is_movie = target.suffix.lower() in MOVIES
    if not is_movie:
        target = _sequence_target(target, manifest, look)
    if options.layered:
        check_layers(target, manifest, line)
    _check_target(target, len(line.shots), force=force, otio=options.otio)
    _check_images(pictures, line)
    levels = picture_warnings(pictures, line, look) if is_movie or format_name(target) in FOR_SCREENS else ()
    warned([*left_out, *look_warnings(manifest, look), *path_warnings(movie, line), *levels])
    if not dry_run:
        write = _write_movie if is_movie else partial(write_sequence, layered=options.layered)
        write(pictures, line, target, look, progress)
        if options.otio:
            write_otio(target, line, manifest)
    where, n_images = target if is_movie else target.parent, len(set(line.shots))
    otio = otio_file(target) if options.otio else None
    return MovieSummary(target=where, n_frames=len(line.shots), n_images=n_images, fps=line.fps, otio=otio)


def _plan(
    path: Path | Sweep, manifest: Manifest, options: MovieOptions, warn: Callable[[str], None]
) -> tuple[MoviePath, Timeline]:
    """Read the path, with options instead of its own values, and find the content of each frame."""
    file = None if isinstance(path, Sweep) else path
    if isinstance(path, Sweep):
        movie = sweep_path(path, manifest)
    else:
        movie = load_movie_path(path, partial(array_problems, manifest=manifest))
    updates = {"fps": options.fps, "positions": options.positions}
    movie = changed(movie, **{key: value for key, value in updates.items() if value is not None})
    line = make_timeline(path.kind or "--cameras" if isinstance(path, Sweep) else path, movie, manifest)
    return movie, mix_timeline(manifest, movie, line, options.sums, file, warn)


def _check_target(target: Path, n_frames: int, *, force: bool, otio: bool) -> None:
    """Refuse what is there already, and formats that cannot be written here."""
    suffix = target.suffix.lower()
    if otio:
        check_otio(target, is_movie=suffix in MOVIES, force=force)
    if suffix not in MOVIES:
        check_earlier(target, n_frames, force=force)
        require_writer(cast(Extension, format_name(target)))  # `sequence_pattern` has checked it
        return
    require_new(target, force=force)
    if suffix in VIDEOS:
        require_encoder(suffix)
    else:
        require_animation(suffix)


def _sequence_target(target: Path, manifest: Manifest, look: Look) -> Path:
    """Return the pattern of a sequence, by default in the array's own format.

    Raises:
        OutputError: it is no pattern, lies in the folder of the array, or its format cannot have this look.
    """
    own = Path(manifest.groups[0].images if manifest.groups else manifest.images).suffix
    target = sequence_pattern(target, own, MOVIES)
    if os.path.realpath(target.parent) == os.path.realpath(manifest.directory):
        raise OutputError(f"{target.parent}: holds the frame array itself; choose another folder")
    check_look(target, look)
    return target


def _check_images(pictures: Pictures, line: Timeline) -> None:
    """Check every image before using the first, so that missing and truncated ones are reported at once."""
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
    for path in sorted(wanted):
        check_image(path, pictures.manifest.resolution)


class _Writer(Protocol):
    def add(self, codes: NDArray[Any]) -> None: ...


def _write_movie(pictures: Pictures, line: Timeline, target: Path, look: Look, report: Progress) -> None:
    bits = VIDEOS[target.suffix.lower()].bits if target.suffix.lower() in VIDEOS else 8
    with folder_for(target.parent), _open_movie(pictures.manifest, line, target) as movie:
        last: tuple[Shot, Relight, NDArray[Any]] | None = None
        for k, (shot, relight) in enumerate(zip(line.shots, line.relights, strict=True)):
            if last is None or last[:2] != (shot, relight):  # a held picture is composed once
                image = pictures.picture(shot.c, shot.positions, relight)
                last = (shot, relight, screen_codes(image, look, shot_label(pictures.manifest, shot), bits))
            movie.add(last[2])
            report(k + 1, len(line.shots))


@contextmanager
def _open_movie(manifest: Manifest, line: Timeline, target: Path) -> Iterator[_Writer]:
    """Open a video or an animation."""
    width, height = manifest.resolution
    if target.suffix.lower() in VIDEOS:
        with open_video(target, width, height, line.fps) as video:
            yield video
    else:
        with open_animation(target, width, height, line.fps, len(line.shots)) as animation:
            yield animation
