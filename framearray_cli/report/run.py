"""`framearray report`: render references and images of many settings, and compare them."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float32
from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import reason
from framearray_cli.job.job import Job

from .case import Case, open_case
from .flip import flip_map, flip_note, require_extra
from .front import Advice, advise, best_front, model_error
from .measure import Measured, measure, measure_single_lights
from .offsets import Offset, measure_offsets
from .probes import Probes, choose_probes
from .reference import Reference, make_reference, passes_for, reference_noise
from .settings import NamedSettings, Settings, methods_to_try, settings_to_try
from .true_light import TrueLight, compare_methods, render_truths
from .truth import Truth, reason_without, true_places

REFERENCES = "references"
_MARKS = (REFERENCES, "table.toml")  # what the folder of an earlier report holds, even if it was stopped
TIMES = 100.0  # samples of a reference over those of a picture


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportOptions:
    """The options of a report.

    Attributes:
        cameras, lights: probe images; if empty, the report chooses a few.
        vary: values to try by the job file's key; `only`: no other key is changed.
        errors: each RMSE to find the cheapest settings for; if empty, the job's own, half of it and twice as much.
        times: samples of a reference over those of a picture.
        truth: True if images are compared with true light, too.
    """

    cameras: Sequence[int] = ()
    lights: Sequence[int] = ()
    vary: Mapping[str, Sequence[Any]] = field(default_factory=dict)
    only: bool = False
    errors: Sequence[float] = ()
    times: float = TIMES
    truth: bool = True


class ReportEvents:
    """The events of a report; override those that you want."""

    def opened(self, case: Case) -> None:
        """The scene was read."""

    def planned(self, references: int, settings: int) -> None:
        """The report will make that many references and measure that many settings."""

    def done(self) -> None:
        """One more of them is done."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Report:
    """The results of a report.

    Attributes:
        settings: the job's own; `measured[0]` is their cost and error.
        reference_hits: native hits per pixel of the references.
        reference_noise: RMSE of the references themselves over their mean.
        true_light: settings and methods with respect to true light; None: `without_truth` says why there is none.
        notes: on ambient and indirect light, such as how far light from cells is from that of paths.
        example: (h, w, 3) the reference of the first probe image.
        flip, signed: (h, w) error of the job's own settings in that image: HDR-FLIP, None without its library, and
            I - R over the mean of R.
    """

    job: Job
    folder: Path
    settings: Settings
    probes: Probes
    measured: tuple[Measured, ...]
    front: tuple[Measured, ...]
    offsets: tuple[Offset, ...]
    advice: tuple[Advice[Measured], ...]
    true_light: TrueLight | None
    without_truth: str
    reference_hits: int
    reference_noise: float
    notes: tuple[str, ...]
    example: Float32
    flip: Float32 | None
    signed: Float32


def _check_folder(folder: Path) -> None:
    """Refuse a folder that holds other files: a report replaces only an earlier one, and uses its references again.

    Raises:
        OutputError: there are files, but none of a report.
    """
    try:
        found = sorted(entry.name for entry in folder.iterdir()) if os.path.exists(folder) else []
    except OSError as error:
        raise OutputError(f"{folder}: cannot be read as a folder: {reason(error)}") from error
    if found and not set(_MARKS) & set(found):
        raise OutputError(f"{folder}: holds other files, {found[0]!r} for one, and no report; choose another folder")


def make_report(job: Job, folder: Path, options: ReportOptions, events: ReportEvents | None = None) -> Report:
    """Measure a job with its own and with other settings; keep references in the folder for the next report.

    Raises:
        MissingExtraError: the libraries of the extra `report` are not installed.
        JobError, SceneError: the job cannot be rendered, or lacks a chosen image or setting.
        OutputError: the folder holds other files, or cannot be written.
    """
    require_extra()
    _check_folder(folder)
    events = events or ReportEvents()
    with open_case(job) as case:
        events.opened(case)
        still, n_l = case.prepared.still, case.prepared.n_lights
        chosen = choose_probes(case.setup.n_frames, n_l, options.cameras, options.lights, file=job.file or job.name)
        n_cameras = 1 if still else case.setup.n_frames
        tried = settings_to_try(case.settings, n_cameras, options.vary, only=options.only)
        frames = [c for run in chosen.cameras for c in run]
        without = reason_without(job) if options.truth else "Nothing is compared with true light: --no-truth."
        methods = {} if without else methods_to_try(case.settings, options.vary, only=options.only)
        n_true = 0 if without else len(true_places(chosen)[0])
        events.planned(len(frames) + n_true, len(tried) + sum(len(some) for some in methods.values()))
        passes = passes_for(options.times, case.settings.window_hits)
        references: dict[int, Reference] = {}
        for c in frames:
            references[c] = make_reference(case, c, chosen.lights, folder / REFERENCES, passes)
            events.done()
        truths = {} if without else render_truths(case, chosen, folder / REFERENCES, events.done)
        measured: list[Measured] = []
        for named in tried:
            measured.append(_measure_one(case, named, chosen, references, truths, measured))
            events.done()
        true_light = compare_methods(case, measured, methods, chosen, truths, options.errors, events.done)
        first, own = references[frames[0]], measured[0]
        right = first.image(0, case.ambient.intensity[chosen.lights[0]])
        wanted = options.errors or [share * own.quality.rmse for share in (2.0, 1.0, 0.5)]
        return Report(
            job=job,
            folder=folder,
            settings=case.settings,
            probes=chosen,
            measured=tuple(measured),
            front=tuple(best_front(measured, model_error)),
            offsets=tuple(measure_offsets(case, frames[0], chosen.lights, first)),
            advice=tuple(advise(measured, wanted, model_error)),
            true_light=true_light,
            without_truth=without or ("" if true_light else "Nothing is compared with true light, which is black."),
            reference_hits=2 * first.hits,
            reference_noise=reference_noise(list(references.values()), case, chosen.lights),
            notes=(*case.ambient.notes, *filter(None, [flip_note()])),
            example=right,
            flip=flip_map(own.example, right),
            signed=np.asarray((own.example - right).mean(axis=-1) / right.mean(dtype=np.float64), np.float32),
        )


def _measure_one(
    case: Case, named: NamedSettings, chosen: Probes, references: dict[int, Reference], truths: dict[int, Truth],
    others: Sequence[Measured],
) -> Measured:  # fmt: skip
    """Measure some settings; `others` were measured before, with reuse among lights before without it."""
    cameras, lights = chosen.cameras, chosen.lights
    if not named.settings.one_light:
        return measure(case, named, cameras, lights, chosen.light_pairs, references, truths)
    shared = replace(named.settings, one_light=False)
    twin = next(other for other in others if other.named.settings == shared)
    return measure_single_lights(case, named, cameras, lights, twin)
