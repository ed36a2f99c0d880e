"""Ways to render the images of a job: the frame array with its options, and what it is compared with."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from framearray_cli.base.forms.table import changed
from framearray_cli.job.job import Job
from framearray_cli.job.read import read_job
from framearray_cli.report.case import Case as Case
from framearray_cli.report.case import choose_images as choose_images
from framearray_cli.report.case import open_case as open_case
from framearray_cli.report.case import with_lights as with_lights
from framearray_cli.report.case import with_settings as with_settings
from framearray_cli.report.settings import Settings

from .results import ROOT

JOBS = ("kitchen", "stairs", "cabin")
QUICK_RESOLUTION = (160, 120)


@dataclass(frozen=True, slots=True, kw_only=True)
class Variant:
    """One way to render the images of a job, and what to measure of it.

    Attributes:
        name: in results and tables.
        settings: those of a report.
        frames: cameras of one timed run.
        floor: replay its rays through Embree only.
        writes: the containers to time it with writing in, too; names of `FORMATS` in `bench/speed/speed.py`.
    """

    name: str
    settings: Settings
    frames: int = 0
    floor: bool = False
    writes: tuple[str, ...] = ()


USUAL_SETTINGS = Settings(n_r=3, weights="average", hits=2, obscurance=5)


def make_variant(
    name: str, *, frames: int = 0, floor: bool = False, writes: tuple[str, ...] = (), **changes: Any
) -> Variant:
    """Return a variant of the usual settings, with changes."""
    return Variant(name=name, settings=replace(USUAL_SETTINGS, **changes), frames=frames, floor=floor, writes=writes)


FRAME_ARRAY = make_variant("frame array", frames=4, floor=True, writes=("zip:1", "none"))
BY_AREA = make_variant("weights area", weights="area", frames=4, floor=True, writes=("none",))
SCRATCH = make_variant("from scratch", n_r=0, hits=14, one_light=True, frames=1, floor=True, writes=("none",))
LIGHT_REUSE = make_variant("light reuse only", n_r=0, hits=14, frames=1)
CAMERA_REUSE = make_variant("camera reuse only", one_light=True, frames=3)

VARIANTS: tuple[Variant, ...] = (
    FRAME_ARRAY,
    make_variant("weights balance", weights="balance", frames=4, floor=True),
    BY_AREA,
    make_variant("hits 0.5, n_r 14", hits=0.5, n_r=14, frames=4),
    LIGHT_REUSE,
    CAMERA_REUSE,
    SCRATCH,
)


def variant_named(name: str) -> Variant:
    """Return the variant of a name."""
    return next(one for one in VARIANTS if one.name == name)


def job_named(name: str, quick: bool) -> Job:
    """Read a job of the project, with smaller images for a quick run."""
    job = read_job(ROOT / "jobs" / f"{name}.toml")
    return with_resolution(job, QUICK_RESOLUTION) if quick else job


def with_resolution(job: Job, resolution: tuple[int, int]) -> Job:
    """Return the job at another resolution."""
    return with_tables(job, {"camera": {"resolution": resolution}})


def with_tables(job: Job, tables: Mapping[str, Mapping[str, Any]]) -> Job:
    """Return the job with some keys of its tables changed."""
    return changed(job, **{name: changed(getattr(job, name), **keys) for name, keys in tables.items()})


def parts_of(case: Case, variant: Variant) -> list[Case]:
    """Return the cases of one run of a variant: one, or one per light position where images share no lights."""
    changed = with_settings(case, variant.settings)
    if not variant.settings.one_light:
        return [changed]
    return [with_lights(changed, [l]) for l in choose_images(case.setup.lights.n_lights, ())]
