"""A job that is open for measuring, also with other settings or a few light positions, and the images to measure."""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

from framearray_cli.base.errors import JobError
from framearray_cli.base.forms.table import changed
from framearray_cli.engine.embree.embreescene import EmbreeScene
from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.engine.terms.ambient.intensity import Ambient
from framearray_cli.job.job import Job
from framearray_cli.job.method import IndirectTable
from framearray_cli.job.values import MOST_HITS
from framearray_cli.render.automatic import resolve_auto
from framearray_cli.render.plan import ambient_at, plan_work
from framearray_cli.render.prepare import Prepared, open_embree, prepare, prepared_from

from .settings import Method, Settings


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Case:
    """A job that is open for measuring, and the setup of its frames.

    Attributes:
        settings: used to plan `setup`.
    """

    prepared: Prepared
    embree: EmbreeScene
    setup: FrameSetup
    ambient: Ambient
    settings: Settings


@contextmanager
def open_case(job: Job) -> Iterator[Case]:
    """Open a job for measuring.

    Raises:
        JobError, SceneError: a render would raise it, or the job stores light by group.
    """
    if job.light.groups:
        problem = "light.sources: expected sources without group and axis, as a report measures images of all light"
        raise JobError(job.file or job.name, [problem])
    with plan_case(prepare(job)) as case:
        yield case


@contextmanager
def plan_case(prepared: Prepared) -> Iterator[Case]:
    """Plan the frames of a job that is prepared."""
    with open_embree(prepared) as embree:
        prepared, _ = resolve_auto(prepared, embree)
        setup, ambient = plan_work(prepared, embree)
        yield Case(prepared=prepared, embree=embree, setup=setup, ambient=ambient, settings=Settings.of(prepared.job))


def with_settings(case: Case, settings: Settings) -> Case:
    """Return the job with other settings.

    They have the job's `indirect.method`, which `with_method` changes. Keep the ambient light. Scale the hits of pixels
    that see a mirror by the same share.
    """
    job = settings.apply_to(case.prepared.job)
    share = settings.window_hits / case.settings.window_hits
    job = changed(
        job,
        specular=changed(job.specular, hits=min(math.ceil(share * job.specular.hits), MOST_HITS)),
        ambient=changed(job.ambient, intensity=(1.0, 1.0, 1.0), paths=1),
        output=changed(job.output, layers=False, alpha=None),
    )
    prepared = replace(case.prepared, job=job)
    plain = replace(prepared, job=changed(job, indirect=IndirectTable(method="obscurance")))  # no cells again
    setup, _ = plan_work(plain, case.embree)
    settings_of_w = setup.indirect.settings._replace(average=case.setup.indirect.settings.average)
    setup = replace(setup, lights=case.setup.lights, indirect=case.setup.indirect.with_settings(settings_of_w))
    return replace(case, prepared=prepared, setup=setup, settings=settings)


def with_method(case: Case, method: Method) -> Case:
    """Return the job with another way to find indirect light."""
    settings = replace(case.settings, indirect=method)
    old = case.prepared
    prepared = prepared_from(settings.apply_to(old.job), old.scene, old.eyes, old.lights)
    setup, ambient = plan_work(prepared, case.embree)
    return replace(case, prepared=prepared, setup=setup, ambient=ambient, settings=settings)


def with_lights(case: Case, l: Sequence[int]) -> Case:
    """Return the job with only light positions l."""
    return replace(case, setup=case.setup.at(l), ambient=ambient_at(case.ambient, l))


# Places on the camera path and on the light path, 0 to 1.
PLACES = (1 / 6, 1 / 2, 5 / 6)


def choose_images(n: int, chosen: Sequence[int]) -> tuple[int, ...]:
    """Return the user's choice of n cameras or light positions in ascending order; if empty, a few over the path."""
    return tuple(sorted(set(chosen) or {int(share * n) for share in PLACES}))
