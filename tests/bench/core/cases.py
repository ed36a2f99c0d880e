"""Ways to make the images of a job: the frame array and its options, and what it is compared with."""

from dataclasses import dataclass, replace

from framearray_cli.job.job import Job
from framearray_cli.job.read import read_job
from framearray_cli.report.case import Case as Case
from framearray_cli.report.case import opened as opened
from framearray_cli.report.case import under as under
from framearray_cli.report.case import varied as with_settings

from .results import ROOT

JOBS = ("kitchen", "stairs", "cabin")
QUICK_RESOLUTION = (160, 120)
# Light positions, as shares of the path, that images of one light are measured at.
PLACES_OF_LIGHT = (1 / 6, 1 / 2, 5 / 6)


@dataclass(frozen=True, slots=True, kw_only=True)
class Variant:
    """One way to make the images of a job.

    Attributes:
        name: in results and tables.
        n_r, hits, obscurance, step, unbiased, balance: as in the job file.
        denoise: W is denoised.
        one_light: every image knows one light position alone.
        frames: cameras of one timed run; 0: only its error is measured, with its time from one short run.
        floor: whether its rays are replayed through Embree alone.
        writes: whether it is timed with writing, too.
    """

    name: str
    n_r: int = 3
    hits: float = 2
    obscurance: int = 5
    step: int = 1
    unbiased: bool = False
    balance: bool = False
    denoise: bool = False
    one_light: bool = False
    frames: int = 0
    floor: bool = False
    writes: bool = False

    @property
    def rests_on(self) -> float:
        """Native hits that a pixel would rest on if every frame of its window saw what it sees."""
        return (2 * self.n_r + 1) * self.hits


FRAME_ARRAY = Variant(name="frame array", frames=4, floor=True, writes=True)
REDUCED = Variant(name="shadow_step 4", step=4, frames=4, floor=True, writes=True)
SCRATCH = Variant(name="from scratch", n_r=0, hits=14, one_light=True, frames=4, floor=True, writes=True)
LIGHT_REUSE = Variant(name="light reuse alone", n_r=0, hits=14, frames=1)
CAMERA_REUSE = Variant(name="camera reuse alone", one_light=True, frames=3)

VARIANTS: tuple[Variant, ...] = (
    FRAME_ARRAY,
    Variant(name="weights balance", balance=True, frames=4, floor=True),
    Variant(name="shadow_step 2", step=2),
    REDUCED,
    Variant(name="shadow_step 8", step=8, frames=4),
    Variant(name="shadow_step 4, unbiased", step=4, unbiased=True, frames=4),
    Variant(name="shadow_step 8, unbiased", step=8, unbiased=True),
    Variant(name="hits 1, n_r 7", hits=1, n_r=7),
    Variant(name="hits 0.5, n_r 14", hits=0.5, n_r=14, frames=4),
    Variant(name="hits 0.5, n_r 14, balance, shadow_step 4", hits=0.5, n_r=14, balance=True, step=4),
    Variant(name="n_r 0", n_r=0),
    Variant(name="n_r 1", n_r=1),
    Variant(name="n_r 7", n_r=7),
    Variant(name="obscurance 1", obscurance=1),
    Variant(name="obscurance 10", obscurance=10),
    Variant(name="denoise", denoise=True, frames=4),
    Variant(name="denoise, obscurance 1", obscurance=1, denoise=True),
    LIGHT_REUSE,
    CAMERA_REUSE,
    SCRATCH,
)


def variant_named(name: str) -> Variant:
    """The variant of a name."""
    return next(variant for variant in VARIANTS if variant.name == name)


def job_named(name: str, quick: bool) -> Job:
    """One of the jobs that come with the project, smaller for a quick run."""
    job = read_job(ROOT / "jobs" / f"{name}.toml")
    return with_resolution(job, QUICK_RESOLUTION) if quick else job


def with_resolution(job: Job, resolution: tuple[int, int]) -> Job:
    """The same job at another resolution."""
    return job.model_copy(update={"camera": job.camera.model_copy(update={"resolution": resolution})})


def varied(case: Case, variant: Variant) -> Case:
    """The same job made another way; every frame counts as an interior one of its path."""
    settings = replace(
        case.settings,
        n_r=variant.n_r,
        weights="balance" if variant.balance else "average",
        hits=variant.hits,
        obscurance=variant.obscurance,
        shadow_step=variant.step,
        shadow_unbiased=variant.unbiased,
        denoise=variant.denoise,
    )
    return with_settings(case, settings)


def parts_of(case: Case, variant: Variant) -> list[Case]:
    """The cases that one run of a variant consists of: one, or one a light position where each image has its own."""
    changed = varied(case, variant)
    if not variant.one_light:
        return [changed]
    n = case.setup.lights.n_lights
    return [under(changed, [min(int(share * n), n - 1)]) for share in PLACES_OF_LIGHT]
