"""What `framearray report` does: references, pictures of many settings, and what follows from them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float32
from framearray_cli.job.job import Job

from .case import Case, opened
from .flip import flip_map, require_extra
from .front import Advice, advice, worth_trying
from .measure import Measured, measure, measure_alone
from .offsets import Offset, by_offset
from .probes import Probes, probes
from .reference import Reference, noise, passes_for, reference
from .settings import Named, Settings, to_try

TIMES = 100.0  # samples of a reference over those of a picture


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportOptions:
    """What the user asks of a report.

    Attributes:
        cameras, lights: probe images; none: a few are chosen.
        vary: values to try by the job file's key.
        errors: RMSE that the cheapest settings are looked for; none: the job's own, half of it and twice as much.
        times: samples of a reference over those of a picture.
    """

    cameras: Sequence[int] = ()
    lights: Sequence[int] = ()
    vary: Mapping[str, Sequence[Any]] = field(default_factory=dict)
    errors: Sequence[float] = ()
    times: float = TIMES


class ReportEvents:
    """Is told how a report goes on; each method may be left as it is."""

    def opened(self, case: Case) -> None:
        """The scene was read."""

    def planned(self, references: int, settings: int) -> None:
        """So many references and settings will be made."""

    def done(self) -> None:
        """One more of them."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Report:
    """Everything that a report shows.

    Attributes:
        settings: the job's own; `measured[0]` is what they cost and give.
        reference_hits: native hits of a pixel of the references.
        reference_noise: RMSE of the references themselves over their mean.
        example: (h, w, 3) the reference of the first probe image.
        flip, signed: (h, w) error of the job's own settings there: HDR-FLIP, and I - R over the mean of R.
    """

    job: Job
    folder: Path
    settings: Settings
    probes: Probes
    measured: tuple[Measured, ...]
    front: tuple[Measured, ...]
    offsets: tuple[Offset, ...]
    advice: tuple[Advice, ...]
    reference_hits: int
    reference_noise: float
    example: Float32
    flip: Float32
    signed: Float32


def make_report(job: Job, folder: Path, options: ReportOptions, events: ReportEvents | None = None) -> Report:
    """Measure a job and its variations; references are kept in the folder and used again.

    Raises:
        MissingExtraError: the libraries of the extra `report` are not installed.
        JobError, SceneError: the job cannot be rendered, or has no such probe image or setting.
        OutputError: the folder cannot be written.
    """
    require_extra()
    events = events or ReportEvents()
    with opened(job) as case:
        events.opened(case)
        still, n_l = case.prepared.still, case.prepared.n_lights
        looked_at = probes(case.setup.n_frames, n_l, options.cameras, options.lights, file=job.file or job.name)
        trying = to_try(case.settings, 1 if still else case.setup.n_frames, options.vary)
        frames = [c for run in looked_at.cameras for c in run]
        events.planned(len(frames), len(trying))
        passes = passes_for(options.times, case.settings.rests_on)
        references: dict[int, Reference] = {}
        for c in frames:
            references[c] = reference(case, c, looked_at.lights, folder / "references", passes)
            events.done()
        measured: list[Measured] = []
        for named in trying:
            measured.append(_measured(case, named, looked_at, references, measured))
            events.done()
        first, own = references[frames[0]], measured[0]
        right = first.image(0, case.ambient.intensity[looked_at.lights[0]])
        wanted = options.errors or [share * own.quality.rmse for share in (2.0, 1.0, 0.5)]
        return Report(
            job=job,
            folder=folder,
            settings=case.settings,
            probes=looked_at,
            measured=tuple(measured),
            front=tuple(worth_trying(measured)),
            offsets=tuple(by_offset(case, frames[0], looked_at.lights, first)),
            advice=tuple(advice(measured, wanted)),
            reference_hits=2 * first.hits,
            reference_noise=noise(list(references.values()), case, looked_at.lights),
            example=right,
            flip=flip_map(own.example, right),
            signed=np.asarray((own.example - right).mean(axis=-1) / right.mean(dtype=np.float64), np.float32),
        )


def _measured(
    case: Case, named: Named, looked_at: Probes, references: dict[int, Reference], others: Sequence[Measured]
) -> Measured:
    """Cost and error of some settings; `others` were measured before, light reuse before the same without it."""
    cameras, lights = looked_at.cameras, looked_at.lights
    if not named.settings.one_light:
        return measure(case, named, cameras, lights, looked_at.light_pairs, references)
    shared = replace(named.settings, one_light=False)
    twin = next(other for other in others if other.named.settings == shared)
    return measure_alone(case, named, cameras, lights, twin)
