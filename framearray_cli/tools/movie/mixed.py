"""Movies whose pictures are sums over light positions: soft light, environments that turn."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from framearray_cli.array.manifest import Manifest
from framearray_cli.base.errors import JobError

from ..mixing.mixer import SumOptions, make_mixer, scaled
from .curves import numbers_at
from .pathfile import EnvironmentLight, MoviePath
from .timeline import Shot, Timeline


def mix_timeline(
    manifest: Manifest,
    movie: MoviePath,
    line: Timeline,
    sums: SumOptions,
    file: Path | None,
    warn: Callable[[str], None],
) -> Timeline:
    """Put sums of light positions in place of the light position of each frame.

    Args:
        sums: options of the command line, in place of what the path says.
        file: of the path; None: a sweep.
        warn: called with what is left out.

    Raises:
        JobError: options exclude each other, or a curve or a file of weights is broken.
        OutputError: the array cannot be summed, or the map cannot be read.
    """
    if not sums.any and movie.environment is not None:
        return _turn(manifest, movie.environment, line, file, warn)
    if not sums.any and movie.soft is not None:
        sums = replace(sums, soft=movie.soft)
    mixer = make_mixer(manifest, sums, warn)
    if mixer is None:
        return line
    last = max(len(line.shots) - 1, 1)
    shots = [Shot(shot.c, tuple(mixer(shot.positions, k / last))) for k, shot in enumerate(line.shots)]
    return replace(line, shots=tuple(shots))


def _turn(
    manifest: Manifest, environment: EnvironmentLight, line: Timeline, file: Path | None, warn: Callable[[str], None]
) -> Timeline:
    """Light each frame by an environment that turns and changes as the curves of a path say."""
    problems: list[str] = []
    times = [float(k / line.fps) for k in range(len(line.shots))]
    rotate = numbers_at("environment.rotate", environment.rotate, times, problems)
    factor = numbers_at("environment.intensity", environment.intensity, times, problems)
    if problems:
        raise JobError(file or "environment", problems)
    panorama = (file.parent if file else Path()) / environment.file
    # A mixer turns the map by its share of 0 to 1 degree: so a share is an angle.
    mixer = make_mixer(manifest, SumOptions(environment=panorama, rotate=(0.0, 1.0)), warn)
    assert mixer is not None
    shots = [
        Shot(shot.c, scaled(tuple(mixer(shot.positions, degrees)), by))
        for shot, degrees, by in zip(line.shots, rotate, factor, strict=True)
    ]
    return replace(line, shots=tuple(shots))
