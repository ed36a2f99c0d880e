"""The content of each frame of a movie: eye, light positions or sums of them, and changes of the light."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from framearray_cli.array.manifest import MAIN_AXIS, Manifest
from framearray_cli.array.mixtures import Position, check_linear
from framearray_cli.array.pictures import Relight
from framearray_cli.array.places import CAMERA_AXIS, nearest_index
from framearray_cli.base.errors import JobError
from framearray_cli.base.forms.schema import toml_key
from framearray_cli.base.units import frame_rate

from ..mixing import SumOptions, make_mixer, mean_around, read_map, scaled, turn_environment
from .lightcurves import LightCurve, relights, values_at
from .pathfile import EASES, MOST_FRAMES, MoviePath, Segment, interpolate_span, resolve_span

# Blended positions are rounded to a millionth of an index, which no picture can show: so a place that is reached in two
# ways has one position.
DECIMALS = 6
_NO_AMBIENT = (
    "ambient: the images of this array hold the indirect light of their own sources, so that it cannot be changed "
    'apart; change the groups, or render again with indirect.method = "obscurance"'
)


@dataclass(frozen=True, slots=True)
class Shot:
    """The place in the array that a frame shows.

    Attributes:
        c: camera index.
        positions: one per light axis, in the order of `Manifest.axes`; fractional ones are blended, mixtures summed.
    """

    c: int
    positions: tuple[Position, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Timeline:
    """All frames of a movie.

    Attributes:
        shots: place of each frame.
        relights: light of each frame.
        fps: frames per second.
    """

    shots: tuple[Shot, ...]
    relights: tuple[Relight, ...]
    fps: Fraction


def make_timeline(source: Path | str, movie: MoviePath, manifest: Manifest) -> Timeline:
    """Find what each frame shows.

    A pass through a segment shows both ends of its spans. A pass that starts exactly where the one before ended does
    not repeat that picture: its steps are 1/n of the way instead of 1/(n - 1), so a movement cut in two keeps its pace.

    Args:
        source: the path file, or another beginning of messages.
        movie: the path.
        manifest: of the frame array.

    Raises:
        JobError: the path names places that the array lacks; the message names all of them.
    """
    fps = frame_rate(movie.fps if movie.fps is not None else manifest.fps)
    now = [0.0] * (1 + len(manifest.axes))  # where the last pass ended: camera, then each light axis
    problems = _light_problems(movie.groups, bool(movie.ambient), manifest)
    total = sum(segment.n_passes * segment.n_frames(fps) + segment.n_held(fps) for segment in movie.segments)
    if total > MOST_FRAMES:
        rate = f"{float(fps):g} frames per second"
        problems.append(f"segments: expected at most {MOST_FRAMES} frames in all, got {total}, at {rate}")
        for k, segment in enumerate(movie.segments):
            _spans(f"segments[{k}]", segment, manifest, now, problems)
        raise JobError(source, problems)
    shots: list[Shot] = []
    for k, segment in enumerate(movie.segments):
        spans = _spans(f"segments[{k}]", segment, manifest, now, problems)
        blends = (segment.positions or movie.positions) == "blend"
        for p in range(segment.n_passes):
            backwards = segment.reverse != (segment.back_and_forth and p % 2 == 1)
            is_continued = shots[-1:] == [_shot(_at(spans, 0.0, segment, backwards), blends)]
            for t in _steps(segment.n_frames(fps), is_continued):
                now = _at(spans, t, segment, backwards)
                shots.append(_shot(now, blends))
        shots += shots[-1:] * segment.n_held(fps)
    lit = relights(movie.groups, movie.ambient, [float(k / fps) for k in range(len(shots))], problems)
    if problems:
        raise JobError(source, problems)
    return Timeline(shots=tuple(shots), relights=tuple(lit), fps=fps)


def _spans(
    key: str, segment: Segment, manifest: Manifest, now: list[float], problems: list[str]
) -> list[tuple[float, ...]]:
    """Resolve the spans of a segment: camera first, then each light axis."""
    sizes = {CAMERA_AXIS: manifest.n_cameras, **manifest.axes}
    found: dict[str, tuple[float, ...]] = {name: (here,) for name, here in zip(sizes, now, strict=True)}
    given = {CAMERA_AXIS: segment.camera, MAIN_AXIS: segment.light, **segment.axes}
    for name in dict.fromkeys((*sizes, *given)):
        if (span := given.get(name)) is not None:
            place = f"{key}.{name if name in (CAMERA_AXIS, MAIN_AXIS) else f'axes.{toml_key(name)}'}"
            if name in sizes:
                found[name] = resolve_span(place, span, sizes[name], name, problems)
            else:
                problems.append(f"{place}: no such light axis; the array has {', '.join(manifest.axes)}")
    return list(found.values())


def array_problems(table: Mapping[str, Any], manifest: Manifest) -> list[str]:
    """List the places and groups in a path file that an array lacks, as far as the file can be read.

    Args:
        table: of the file, which has other problems as well; they are left out.
    """
    problems: list[str] = []
    segments = table.get("segments")
    for k, entry in enumerate(segments if isinstance(segments, list) else ()):
        axes = entry.get("axes") if isinstance(entry, dict) else None
        given = [{key: entry[key]} for key in ("camera", "light") if key in entry] if isinstance(entry, dict) else []
        given += [{"axes": {name: span}} for name, span in axes.items()] if isinstance(axes, dict) else []
        for keys in given:
            with suppress(ValidationError):
                segment = Segment.model_validate({"frames": 1, **keys})
                _spans(f"segments[{k}]", segment, manifest, [0.0] * (1 + len(manifest.axes)), problems)
    groups = table.get("groups")
    return problems + _light_problems(groups if isinstance(groups, dict) else {}, "ambient" in table, manifest)


def _light_problems(groups: Iterable[str], ambient: bool, manifest: Manifest) -> list[str]:
    """List changes of the light of groups, by their names, and of ambient light, that the array cannot show."""
    if not manifest.groups:
        keys = [f"groups.{toml_key(name)}" for name in groups] + (["ambient"] if ambient else [])
        return [
            f"{key}: this array stores its light all together, so that it cannot be changed; render again with "
            'group = "..." in [[light.sources]]'
            for key in keys
        ]
    known = manifest.group_names
    whole = [] if manifest.uses_ambient or not ambient else [_NO_AMBIENT]
    return whole + [
        f"groups.{toml_key(name)}: no such group; the array has {', '.join(known)}"
        for name in groups
        if name not in known
    ]


def _at(spans: list[tuple[float, ...]], t: float, segment: Segment, backwards: bool) -> list[float]:
    """Return the positions at a share t of the time of a pass."""
    u = EASES[segment.ease](1 - t if backwards else t)
    return [interpolate_span(span, u) for span in spans]


def _shot(now: list[float], blends: bool) -> Shot:
    """Return the shot at these positions: the nearest eye, and the nearest light or a blend."""
    lights = (round(x, DECIMALS) if blends else nearest_index(x) for x in now[1:])
    return Shot(nearest_index(now[0]), tuple(lights))


def _steps(n: int, is_continued: bool) -> list[float]:
    """Space n frames evenly over [0, 1]: the last is 1; the first is 0, or one step further if 0 was shown before."""
    if is_continued:
        return [(k + 1) / n for k in range(n)]
    return [k / (n - 1) for k in range(n)] if n > 1 else [0.0]


def mix_timeline(
    source: Path | str,
    movie: MoviePath,
    manifest: Manifest,
    line: Timeline,
    sums: SumOptions,
    warn: Callable[[str], None],
) -> Timeline:
    """Replace the light position of each frame by a sum of light positions.

    Args:
        source: as for `make_timeline`.
        sums: options of the command line, which override the path.
        warn: called with what is left out.

    Raises:
        JobError: options exclude each other, or a curve is broken.
        OutputError: the array cannot be summed, or the map cannot be read.
    """
    found: Sequence[Position]
    if mixer := make_mixer(manifest, sums, warn):
        last = max(len(line.shots) - 1, 1)
        found = [mixer(shot.positions[0], k / last) for k, shot in enumerate(line.shots)]
    elif movie.environment is not None:
        environment = movie.environment
        curves = {"environment.rotate": environment.rotate, "environment.intensity": environment.intensity}
        rotate, factor = _values_at(curves, line, source)
        check_linear(manifest)
        panorama = Path(source).parent / environment.file
        turned = turn_environment(manifest, panorama, read_map(panorama), 0.0, warn)
        found = [scaled(turned(degrees), by) for degrees, by in zip(rotate, factor, strict=True)]
    elif movie.soft is not None:
        (widths,) = _values_at({"soft": movie.soft}, line, source)
        check_linear(manifest)
        pairs = zip(line.shots, widths, strict=True)
        found = [mean_around(shot.positions[0], width, manifest.n_lights) for shot, width in pairs]
    else:
        return line
    both = zip(line.shots, found, strict=True)
    return replace(line, shots=tuple(Shot(shot.c, (position, *shot.positions[1:])) for shot, position in both))


def _values_at(curves: Mapping[str, LightCurve], line: Timeline, source: Path | str) -> list[list[float]]:
    """Return the values of curves of single numbers, by their keys in the path, at each frame."""
    problems: list[str] = []
    times = [float(k / line.fps) for k in range(len(line.shots))]
    found = [values_at(key, curve, times, problems)[:, 0].tolist() for key, curve in curves.items()]
    if problems:
        raise JobError(source, problems)
    return found
