"""Movies whose pictures are sums over light positions: soft light, weights from files, environments that turn."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

from framearray_cli.array.manifest import Manifest
from framearray_cli.array.mixtures import check_linear, check_mixture
from framearray_cli.base.errors import JobError

from ..mixing.mixer import SumOptions, make_mixer, mixture_of, scaled
from ..mixing.weightfile import read_weights
from .curves import FileCurve, LightCurve, numbers_at
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
        return _soften(manifest, movie.soft, line, file, warn)
    if not sums.any and movie.weights is not None:
        return _weigh(manifest, movie.weights, line, file)
    mixer = make_mixer(manifest, sums, warn)
    if mixer is None:
        return line
    last = max(len(line.shots) - 1, 1)
    shots = [Shot(shot.c, tuple(mixer(shot.positions, k / last))) for k, shot in enumerate(line.shots)]
    return replace(line, shots=tuple(shots))


def _soften(
    manifest: Manifest, width: LightCurve, line: Timeline, file: Path | None, warn: Callable[[str], None]
) -> Timeline:
    """Put means of as many light positions as a curve says in place of those of each frame."""
    (widths,) = _values_at({"soft": width}, line, file)
    mixers = {width: make_mixer(manifest, SumOptions(soft=width), warn) for width in set(widths)}
    shots: list[Shot] = []
    for shot, wide in zip(line.shots, widths, strict=True):
        mixer = mixers[wide]
        assert mixer is not None
        shots.append(Shot(shot.c, tuple(mixer(shot.positions, 0.0))))
    return replace(line, shots=tuple(shots))


def _weigh(manifest: Manifest, curve: FileCurve, line: Timeline, file: Path | None) -> Timeline:
    """Put sums with weights from files in place of the light positions; between two key frames both files count."""
    (places,) = _values_at({"weights": curve.places}, line, file)
    check_linear(manifest)
    folder = file.parent if file else Path()
    tables = {name: read_weights(folder / name, manifest.n_lights) for name in set(curve.files)}
    shots: list[Shot] = []
    for shot, place in zip(line.shots, places, strict=True):
        k = int(place)
        near, far = tables[curve.files[k]], tables[curve.files[min(k + 1, len(curve.files) - 1)]]
        mixture = mixture_of(near + (far - near) * (place - k))
        check_mixture(manifest, mixture)
        shots.append(Shot(shot.c, (mixture, *shot.positions[1:])))
    return replace(line, shots=tuple(shots))


def _values_at(curves: Mapping[str, LightCurve], line: Timeline, file: Path | None) -> list[list[float]]:
    """Return the values of curves of single numbers, by their keys in the path, at each frame.

    Raises:
        JobError: key frames are out of order.
    """
    problems: list[str] = []
    times = [float(k / line.fps) for k in range(len(line.shots))]
    found = [numbers_at(key, curve, times, problems) for key, curve in curves.items()]
    if problems:
        raise JobError(file or next(iter(curves)), problems)
    return found


def _turn(
    manifest: Manifest, environment: EnvironmentLight, line: Timeline, file: Path | None, warn: Callable[[str], None]
) -> Timeline:
    """Light each frame by an environment that turns and changes as the curves of a path say."""
    curves = {"environment.rotate": environment.rotate, "environment.intensity": environment.intensity}
    rotate, factor = _values_at(curves, line, file)
    panorama = (file.parent if file else Path()) / environment.file
    # A mixer turns the map by its share of 0 to 1 degree: so a share is an angle.
    mixer = make_mixer(manifest, SumOptions(environment=panorama, rotate=(0.0, 1.0)), warn)
    assert mixer is not None
    shots = [
        Shot(shot.c, scaled(tuple(mixer(shot.positions, degrees)), by))
        for shot, degrees, by in zip(line.shots, rotate, factor, strict=True)
    ]
    return replace(line, shots=tuple(shots))
