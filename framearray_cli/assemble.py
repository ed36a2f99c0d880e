"""A movie path through a frame array -> a movie, or a numbered image sequence; from the manifest alone."""

import re
import secrets
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TypeAlias, get_args

from .arrays import Bytes
from .colour import srgb8_from_linear
from .errors import OutputError
from .files import make_folder, reason
from .imageattributes import frame_attributes
from .images import Extension, ImageFormat, read_codes, read_image, write_image
from .manifest import Manifest, image_path
from .manifestfile import read_manifest
from .moviepath import frame_list, load_movie_path, movie_fps
from .movies import CONTAINERS, open_movie, require_av

Progress: TypeAlias = Callable[[int, int], None]  # frames done, frames in all
Frames: TypeAlias = Sequence[tuple[int, int]]  # (c, l) of each frame

_SAME = {".jpeg": ".jpg", ".tiff": ".tif"}


@dataclass(frozen=True, slots=True, kw_only=True)
class AssembleResult:
    """What was made.

    Attributes:
        target: the movie, or the folder of the sequence.
        n_frames: frames in it.
        n_images: different images of the array among them.
        fps: frames per second.
    """

    target: Path
    n_frames: int
    n_images: int
    fps: Fraction

    @property
    def time_s(self) -> Fraction:
        """How long it plays, seconds."""
        return self.n_frames / self.fps


def assemble(
    out: Path, path_file: Path, target: Path, *, exposure: float = 0.0, progress: Progress | None = None
) -> AssembleResult:
    """Cut a movie or an image sequence out of a frame array; it appears whole or not at all.

    Args:
        out: output folder of a render, or its manifest.
        path_file: TOML file of segments, see docs/movies.md.
        target: "x.mp4" (also .mov, .mkv, .webm); "x.####.png" (also .exr, .tif, .jpg) with as many digits as "#";
            a name without suffix is a folder, filled with "frame.####" in the array's own format.
        exposure: stops added to movies, PNG and JPEG.
        progress: called after each frame.

    Raises:
        JobError: the path file is broken or asks for what the array has not.
        OutputError: an image is missing or damaged, or the target cannot be written.
        MissingExtraError: a movie is asked for and PyAV is not installed.
    """
    manifest = read_manifest(out)
    movie = load_movie_path(path_file)
    frames = frame_list(path_file, movie, manifest)
    fps = movie_fps(movie, manifest)
    suffix = target.suffix.lower()
    report = progress or (lambda done, total: None)
    if suffix in CONTAINERS:
        require_av()
        _check_images(manifest, frames)
        _write_movie(manifest, frames, target, fps, exposure, report)
    else:
        pattern = _sequence_pattern(target, Path(manifest.images).suffix)
        _check_exposure(pattern, exposure)
        _check_images(manifest, frames)
        _write_sequence(manifest, frames, pattern, fps, exposure, report)
        target = pattern.parent
    return AssembleResult(target=target, n_frames=len(frames), n_images=len(set(frames)), fps=fps)


def _check_images(manifest: Manifest, frames: Frames) -> None:
    """Look for every image before the first is used."""
    wanted = sorted(set(frames))
    missing = [(c, l) for c, l in wanted if not image_path(manifest, c, l).is_file()]
    if missing:
        c, l = missing[0]
        raise OutputError(
            f"{image_path(manifest, c, l)}: no such file (camera {c}, light {l}); "
            f"{len(missing)} of the {len(wanted)} images on the path are missing; render the rest first"
        )


def _write_movie(
    manifest: Manifest, frames: Frames, target: Path, fps: Fraction, exposure: float, report: Progress
) -> None:
    width, height = manifest.resolution
    with open_movie(target, width, height, fps) as movie:
        last: tuple[tuple[int, int], Bytes] | None = None
        for done, frame in enumerate(frames, start=1):
            if last is None or last[0] != frame:  # a held image is read once
                last = (frame, _codes(manifest, *frame, exposure))
            movie.add(last[1])
            report(done, len(frames))


def _codes(manifest: Manifest, c: int, l: int, exposure: float) -> Bytes:
    """Read image [c, l] as it looks on a screen: (h, w, 3) sRGB codes."""
    path = image_path(manifest, c, l)
    if not exposure and _kind(path) in (".png", ".jpg"):
        codes = read_codes(path)
    else:
        codes = srgb8_from_linear(read_image(path) * 2.0**exposure)
    width, height = manifest.resolution
    if codes.shape != (height, width, 3):
        raise OutputError(f"{path}: expected {width} x {height} pixels, got {codes.shape[1]} x {codes.shape[0]}")
    return codes


def _kind(path: Path) -> str:
    """Return the suffix in its usual spelling."""
    suffix = path.suffix.lower()
    return _SAME.get(suffix, suffix)


def _sequence_pattern(target: Path, own_suffix: str) -> Path:
    """Find the pattern of a sequence: a path whose name has one run of "#"."""
    if not target.suffix or target.is_dir():
        return target / f"frame.####{own_suffix}"
    images = ", ".join(f".{name}" for name in get_args(Extension))
    if _kind(target)[1:] not in get_args(Extension):
        raise OutputError(
            f"{target}: expected {', '.join(CONTAINERS)} (a movie), {images} (numbered images) or a folder"
        )
    if len(re.findall("#+", target.name)) != 1:
        raise OutputError(f'{target}: expected a name with "####" where the frame number goes, as in frame.####.png')
    return target


def _check_exposure(pattern: Path, exposure: float) -> None:
    if exposure and _kind(pattern) not in (".png", ".jpg"):
        raise OutputError(
            f"{pattern}: exposure changes movies, PNG and JPEG alone; {pattern.suffix} keeps the radiance"
        )


def _write_sequence(
    manifest: Manifest, frames: Frames, pattern: Path, fps: Fraction, exposure: float, report: Progress
) -> None:
    """Write all frames into a folder beside the place, then move them there."""
    before, digits, after = re.split("(#+)", pattern.name)
    names = [f"{before}{k:0{len(digits)}d}{after}" for k in range(len(frames))]
    _check_leftovers(pattern.parent, before, after, set(names))
    make_folder(pattern.parent)
    part = pattern.parent / f".{before}{secrets.token_hex(4)}.part"
    try:
        part.mkdir()
        for done, (name, (c, l)) in enumerate(zip(names, frames, strict=True), start=1):
            _write_frame(manifest, c, l, part / name, fps, exposure)
            report(done, len(frames))
        for name in names:
            (part / name).replace(pattern.parent / name)
    except OSError as error:
        raise OutputError(f"{pattern}: cannot be written: {reason(error)}") from error
    finally:
        shutil.rmtree(part, ignore_errors=True)


def _check_leftovers(folder: Path, before: str, after: str, names: set[str]) -> None:
    """Refuse to leave frames of an earlier, longer sequence behind the last one of this."""
    number = re.compile(re.escape(before) + r"\d+" + re.escape(after))
    entries = sorted(entry.name for entry in folder.iterdir()) if folder.is_dir() else []
    left = [name for name in entries if number.fullmatch(name) and name not in names]
    if left:
        raise OutputError(
            f"{folder / left[0]}: belongs to an earlier sequence, with {len(left)} files that this one would not "
            "replace; delete them or choose another name"
        )


def _write_frame(manifest: Manifest, c: int, l: int, target: Path, fps: Fraction, exposure: float) -> None:
    """Copy one image, or convert it where the format or the exposure differs."""
    source = image_path(manifest, c, l)
    if _kind(source) == _kind(target) and not exposure:
        read_image(source)  # a damaged image must not slip into the sequence
        shutil.copyfile(source, target)
        return
    camera = manifest.cameras[c]
    attributes = frame_attributes(
        world_from_camera=camera.matrix,
        fov_deg=camera.fov,
        resolution=manifest.resolution,
        fps=fps,
        c=c,
        l=l,
        software=f"framearray {manifest.version}",
    )
    image_format: Extension = _kind(target)[1:]  # type: ignore[assignment]  # checked by _sequence_pattern
    write_image(target, read_image(source), ImageFormat(format=image_format, exposure=exposure), attributes)
