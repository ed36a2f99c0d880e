"""`framearray report`: render references and images of many settings, compare them, and find the best."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np

from framearray_cli.base.arrays import Float32
from framearray_cli.base.errors import OutputError
from framearray_cli.base.extras import not_installed
from framearray_cli.base.files import reason
from framearray_cli.job.job import Job

from .case import Case, choose_images, open_case, with_method
from .measure import Measured, MeasuredMethod, measure, measure_method, measure_single_lights
from .reference import Reference, make_reference, passes_for, reference_noise
from .settings import SCRATCH, Method, NamedSettings, methods_to_try, settings_to_try
from .truth import HITS, PASSES, TruthError, reason_without, true_case, true_places

# Settings reach an error if theirs is at most this many times as large: measured errors are noisy.
SLACK = 1.02


_Timed = TypeVar("_Timed", bound=MeasuredMethod)


@dataclass(frozen=True, slots=True, kw_only=True)
class Advice(Generic[_Timed]):
    """The cheapest settings for an error.

    Attributes:
        error: the target RMSE.
        best: None if no tested settings reach it.
    """

    error: float
    best: _Timed | None


def model_error(one: Measured) -> float:
    """RMSE with respect to the reference of the job's own way to find indirect light."""
    return one.quality.rmse


def best_front(measured: Sequence[_Timed], error_of: Callable[[_Timed], float]) -> list[_Timed]:
    """Return the settings that no others beat in both time and error, the quickest first."""
    front: list[_Timed] = []
    for one in sorted(measured, key=lambda m: (m.ms, error_of(m))):
        if not front or error_of(one) < error_of(front[-1]):
            front.append(one)
    return front


def advise(
    measured: Sequence[_Timed], wanted: Sequence[float], error_of: Callable[[_Timed], float]
) -> list[Advice[_Timed]]:
    """Return the cheapest settings for each error, without those for single lights, which no job can have."""
    usable = [m for m in measured if not m.named.settings.one_light]
    found = []
    for error in wanted:
        good = [m for m in usable if error_of(m) <= SLACK * error]
        found.append(Advice(error=error, best=min(good, key=lambda m: m.ms, default=None)))
    return found


def times_faster(one: Measured, measured: Sequence[Measured]) -> float | None:
    """Return the time of images from scratch over the time of settings with the same RMSE; None if not measured.

    Interpolate time over error between the two nearest numbers of hits, on logarithmic axes. Extrapolate as noise
    behaves: four times the time for half the error.
    """
    scratch = sorted((m.quality.rmse, m.ms) for m in measured if m.named.family == SCRATCH)
    if not scratch:
        return None
    errors, times = (np.log([pair[i] for pair in scratch]) for i in (0, 1))
    wanted = np.log(one.quality.rmse)
    if wanted <= errors[0]:
        time = times[0] + 2 * (errors[0] - wanted)
    elif wanted >= errors[-1]:
        time = times[-1] - 2 * (wanted - errors[-1])
    else:
        time = np.interp(wanted, errors, times)
    return float(np.exp(time) / one.ms)


# Errors to find settings for, over the error of the job's own settings.
SHARES = (1.0, 0.5, 0.25)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Comparison(Generic[_Timed]):
    """Settings whose images were compared with references.

    Attributes:
        cameras, lights: each of these cameras was measured under each of these light positions.
        hits: native hits per pixel of the references.
        noise: RMSE of the references themselves over their mean.
        measured: cost and error of the job's own settings first, then of others.
    """

    cameras: tuple[int, ...]
    lights: tuple[int, ...]
    hits: int
    noise: float
    measured: tuple[_Timed, ...]
    front: tuple[_Timed, ...]
    advice: tuple[Advice[_Timed], ...]


class TrueLight(Comparison[MeasuredMethod]):
    """Settings and other methods with respect to true light, PATHS paths of each hit; all have a `truth`.

    Errors are without the noise of true light.
    """

    __slots__ = ()

    @property
    def methods(self) -> tuple[MeasuredMethod, ...]:
        """The job's own settings, and those with another method."""
        return (self.measured[0], *(one for one in self.measured if not isinstance(one, Measured)))


def truth_of(one: MeasuredMethod) -> TruthError:
    """The error of settings of `TrueLight`."""
    assert one.truth is not None
    return one.truth


def true_rmse(one: MeasuredMethod) -> float:
    """RMSE with respect to true light."""
    return truth_of(one).rmse


def compare_methods(
    case: Case, measured: Sequence[Measured], methods: dict[Method, list[NamedSettings]], lights: Sequence[int],
    truths: dict[int, Reference], rows: Sequence[int], errors: Sequence[float], done: Callable[[], object],
) -> TrueLight | None:  # fmt: skip
    """Measure settings with other methods, next to the measured ones; None if all is black.

    Args:
        lights: of the report; `rows`: which of them are known in true light.
        errors: each RMSE to find the cheapest settings for; if empty, shares of the RMSE of the job's own settings.
    """
    found: list[MeasuredMethod] = [one for one in measured if one.truth is not None]
    if not found:
        return None
    for method, tried in methods.items():
        changed = with_method(case, method)
        for named in tried:
            found.append(measure_method(changed, named, lights, truths, rows))
            done()
    return TrueLight(
        cameras=tuple(truths),
        lights=tuple(lights[i] for i in rows),
        hits=2 * HITS * PASSES,
        noise=reference_noise(list(truths.values()), case, [lights[i] for i in rows]),
        measured=tuple(found),
        front=tuple(best_front(found, true_rmse)),
        advice=tuple(advise(found, errors or [share * true_rmse(found[0]) for share in SHARES], true_rmse)),
    )


EXTRA = ("matplotlib", "jinja2")  # libraries of the extra `report`
REFERENCES = "references"
_MARKS = (REFERENCES, "table.toml")  # what the folder of an earlier report holds, even if it was stopped
TIMES = 100.0  # samples of a reference over samples of a picture


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportOptions:
    """The options of a report.

    Attributes:
        cameras, lights: images to measure; if empty, the report chooses a few.
        vary: values to try by the job file's key; `only`: no other key is changed.
        errors: each RMSE to find the cheapest settings for; if empty, the job's own, half of it and twice as much.
        times: samples of a reference over samples of a picture.
        truth: True if images are compared with true light, too.
    """

    cameras: Sequence[int] = ()
    lights: Sequence[int] = ()
    vary: Mapping[str, Sequence[Any]] = field(default_factory=dict)
    only: bool = False
    errors: Sequence[float] = ()
    times: float = TIMES
    truth: bool = True


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Report(Comparison[Measured]):
    """The results of a report: a comparison with the reference of the job's own way to find indirect light.

    Attributes:
        true_light: settings and methods with respect to true light; None: `without_truth` is the reason.
        notes: on ambient and indirect light, such as the difference between light from cells and from paths.
        example: (h, w, 3) the reference of the first image.
        signed: (h, w) error of the job's own settings in that image, I - R over the mean of R.
    """

    job: Job
    folder: Path
    true_light: TrueLight | None
    without_truth: str
    notes: tuple[str, ...]
    example: Float32
    signed: Float32


def _check_folder(folder: Path) -> None:
    """Refuse a folder with other files: a report replaces only an earlier one, and uses its references again.

    Raises:
        OutputError: there are files, but none of a report.
    """
    try:
        found = sorted(entry.name for entry in folder.iterdir()) if os.path.exists(folder) else []
    except OSError as error:
        raise OutputError(f"{folder}: cannot be read as a folder: {reason(error)}") from error
    if found and not set(_MARKS) & set(found):
        raise OutputError(f"{folder}: holds other files, {found[0]!r} for one, and no report; choose another folder")


def make_report(
    job: Job,
    folder: Path,
    options: ReportOptions,
    planned: Callable[[Case, int], object] = lambda case, steps: None,
    done: Callable[[], object] = lambda: None,
) -> Report:
    """Measure a job with its own and with other settings; keep references in the folder for the next report.

    Args:
        planned: called with the scene, and the number of references and settings; `done`: after each of them.

    Raises:
        MissingExtraError: the libraries of the extra `report` are not installed.
        JobError, SceneError: the job cannot be rendered, or has no such setting.
        OutputError: the folder has other files, or cannot be written.
    """
    if not all(map(find_spec, EXTRA)):
        raise not_installed(f"a report needs {' and '.join(EXTRA)}", "[report]")
    _check_folder(folder)
    with open_case(job) as case:
        cameras = choose_images(case.setup.n_frames, options.cameras)
        lights = choose_images(case.prepared.n_lights, options.lights)
        n_cameras = 1 if case.prepared.still else case.setup.n_frames
        tried = settings_to_try(case.settings, n_cameras, options.vary, only=options.only)
        without = reason_without(job) if options.truth else "Nothing is compared with true light: --no-truth."
        methods = {} if without else methods_to_try(case.settings, options.vary, only=options.only)
        true_cameras, rows = ((), ()) if without else true_places(cameras, lights)
        steps = len(cameras) + len(true_cameras) + len(tried) + sum(len(some) for some in methods.values())
        planned(case, steps)
        kept, passes = folder / REFERENCES, passes_for(options.times, case.settings.window_hits)
        references = _make_each(lambda c: make_reference(case, c, lights, kept, passes), cameras, done)
        paths, true_lights = case if without else true_case(case), [lights[i] for i in rows]
        truths = _make_each(lambda c: make_reference(paths, c, true_lights, kept, PASSES, HITS), true_cameras, done)
        measured: list[Measured] = []
        for named in tried:
            measured.append(_measure_one(case, named, lights, references, truths, rows, measured))
            done()
        true_light = compare_methods(case, measured, methods, lights, truths, rows, options.errors, done)
        first, own = references[cameras[0]], measured[0]
        right = first.image(0, case.ambient.intensity[lights[0]])
        wanted = options.errors or [share * own.quality.rmse for share in (2.0, 1.0, 0.5)]
        return Report(
            job=job,
            folder=folder,
            cameras=cameras,
            lights=lights,
            measured=tuple(measured),
            front=tuple(best_front(measured, model_error)),
            advice=tuple(advise(measured, wanted, model_error)),
            true_light=true_light,
            without_truth=without or ("" if true_light else "Nothing is compared with true light, which is black."),
            hits=2 * first.hits,
            noise=reference_noise(list(references.values()), case, lights),
            notes=case.ambient.notes,
            example=right,
            signed=np.asarray((own.example - right).mean(axis=-1) / right.mean(dtype=np.float64), np.float32),
        )


def _make_each(
    make: Callable[[int], Reference], cameras: Sequence[int], done: Callable[[], object]
) -> dict[int, Reference]:
    found = {}
    for c in cameras:
        found[c] = make(c)
        done()
    return found


def _measure_one(
    case: Case, named: NamedSettings, lights: Sequence[int], references: dict[int, Reference],
    truths: dict[int, Reference], rows: Sequence[int], others: Sequence[Measured],
) -> Measured:  # fmt: skip
    """Measure some settings; `others` were measured before, with reuse among lights before without it."""
    if not named.settings.one_light:
        return measure(case, named, lights, references, truths, rows)
    shared = replace(named.settings, one_light=False)
    twin = next(other for other in others if other.named.settings == shared)
    return measure_single_lights(case, named, tuple(references), lights, twin)
