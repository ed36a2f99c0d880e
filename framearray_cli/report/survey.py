"""`framearray report`: render references and images of many settings, compare them, and find the best."""

import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

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
from .truth import HITS, PASSES, reason_without, true_case, true_places


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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Comparison(ABC):
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
    measured: Sequence[MeasuredMethod]

    @staticmethod
    @abstractmethod
    def rmse(one: Any) -> float:
        """RMSE of settings with respect to the references, over their mean."""

    @property
    def front(self) -> list[MeasuredMethod]:
        """The settings that no others beat in both time and error, the quickest first."""
        front: list[MeasuredMethod] = []
        for one in sorted(self.measured, key=lambda m: (m.ms, self.rmse(m))):
            if not front or self.rmse(one) < self.rmse(front[-1]):
                front.append(one)
        return front


class TrueLight(Comparison):
    """Settings and other methods with respect to true light, PATHS paths of each hit; all have a `truth`.

    Errors are without the noise of true light.
    """

    __slots__ = ()

    @staticmethod
    def rmse(one: MeasuredMethod) -> float:
        """RMSE with respect to true light."""
        assert one.truth is not None
        return one.truth.rmse

    @property
    def methods(self) -> tuple[MeasuredMethod, ...]:
        """The job's own settings, and those with another method."""
        return (self.measured[0], *(one for one in self.measured if not isinstance(one, Measured)))


def compare_methods(
    case: Case, measured: Sequence[Measured], methods: dict[Method, list[NamedSettings]], lights: Sequence[int],
    truths: dict[int, Reference], rows: Sequence[int], done: Callable[[], object],
) -> TrueLight | None:  # fmt: skip
    """Measure settings with other methods, next to the measured ones; None if all is black.

    Args:
        lights: of the report; `rows`: which of them are known in true light.
    """
    found: list[MeasuredMethod] = [one for one in measured if one.truth is not None]
    if not found:
        return None
    for method, tried in methods.items():
        changed = with_method(case, method)
        for named in tried:
            found.append(measure_method(changed, named, lights, truths, rows))
            done()
    true_lights = tuple(lights[i] for i in rows)
    noise = reference_noise(list(truths.values()), case, true_lights)
    return TrueLight(
        cameras=tuple(truths), lights=true_lights, hits=2 * HITS * PASSES, noise=noise, measured=tuple(found)
    )


EXTRA = ("matplotlib", "jinja2")  # libraries of the extra `report`
REFERENCES = "references"
_MARKS = (REFERENCES, "table.toml")  # what the folder of an earlier report holds, even if it was stopped


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Report(Comparison):
    """The results of a report: a comparison with the reference of the job's own way to find indirect light.

    Attributes:
        true_light: settings and methods with respect to true light; None: `without_truth` is the reason.
        notes: on ambient and indirect light, such as the difference between light from cells and from paths.
        example: (h, w, 3) the reference of the first image.
        signed: (h, w) error of the job's own settings in that image, I - R over the mean of R.
    """

    measured: Sequence[Measured]
    job: Job
    folder: Path
    true_light: TrueLight | None
    without_truth: str
    notes: tuple[str, ...]
    example: Float32
    signed: Float32

    @staticmethod
    def rmse(one: Measured) -> float:
        """RMSE with respect to the reference of the job's own way to find indirect light."""
        return one.quality.rmse


def _check_folder(folder: Path) -> None:
    """Refuse a folder with other files: a report replaces only an earlier one, and uses its references again."""
    try:
        found = sorted(entry.name for entry in folder.iterdir()) if os.path.exists(folder) else []
    except OSError as error:
        raise OutputError(f"{folder}: cannot be read as a folder: {reason(error)}") from error
    if found and not set(_MARKS) & set(found):
        raise OutputError(f"{folder}: holds other files, {found[0]!r} for one, and no report; choose another folder")


def make_report(
    job: Job,
    folder: Path,
    *,
    cameras: Sequence[int] = (),
    lights: Sequence[int] = (),
    vary: Mapping[str, Sequence[Any]] | None = None,
    truth: bool = True,
    planned: Callable[[Case, int], object] = lambda case, steps: None,
    done: Callable[[], object] = lambda: None,
) -> Report:
    """Measure a job with its own and with other settings; keep references in the folder for the next report.

    Args:
        cameras, lights: images to measure; if empty, the report chooses a few.
        vary: values to try by the job file's key; without any, the report varies all keys.
        truth: True if images are compared with true light, too.
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
        cameras = choose_images(case.setup.n_frames, cameras)
        lights = choose_images(case.prepared.n_lights, lights)
        tried = settings_to_try(case.settings, 1 if case.prepared.still else case.setup.n_frames, vary)
        without = reason_without(job) if truth else "Nothing is compared with true light: --no-truth."
        methods = {} if without else methods_to_try(case.settings, vary)
        true_cameras, rows = ((), ()) if without else true_places(cameras, lights)
        planned(case, len(cameras) + len(true_cameras) + len(tried) + sum(len(some) for some in methods.values()))
        kept, passes = folder / REFERENCES, passes_for(case.settings.window_hits)
        references = _make_each(lambda c: make_reference(case, c, lights, kept, passes), cameras, done)
        paths, true_lights = case if without else true_case(case), [lights[i] for i in rows]
        truths = _make_each(lambda c: make_reference(paths, c, true_lights, kept, PASSES, HITS), true_cameras, done)
        measured = _measure_all(case, tried, lights, references, truths, rows, done)
        true_light = compare_methods(case, measured, methods, lights, truths, rows, done)
        first = references[cameras[0]]
        right = first.image(0, case.ambient.intensity[lights[0]])
        error = (measured[0].example - right).mean(axis=-1) / right.mean(dtype=np.float64)
        return Report(
            job=job,
            folder=folder,
            cameras=cameras,
            lights=lights,
            measured=measured,
            true_light=true_light,
            without_truth=without or ("" if true_light else "Nothing is compared with true light, which is black."),
            hits=2 * first.hits,
            noise=reference_noise(list(references.values()), case, lights),
            notes=case.ambient.notes,
            example=right,
            signed=np.asarray(error, np.float32),
        )


def _make_each(
    make: Callable[[int], Reference], cameras: Sequence[int], done: Callable[[], object]
) -> dict[int, Reference]:
    found = {}
    for c in cameras:
        found[c] = make(c)
        done()
    return found


def _measure_all(
    case: Case, tried: Sequence[NamedSettings], lights: Sequence[int], references: dict[int, Reference],
    truths: dict[int, Reference], rows: Sequence[int], done: Callable[[], object],
) -> list[Measured]:  # fmt: skip
    """Measure settings in order: those with reuse among lights before the same without it."""
    measured: list[Measured] = []
    for named in tried:
        if named.settings.one_light:
            shared = replace(named.settings, one_light=False)
            twin = next(other for other in measured if other.named.settings == shared)
            measured.append(measure_single_lights(case, named, tuple(references), lights, twin))
        else:
            measured.append(measure(case, named, lights, references, truths, rows))
        done()
    return measured
