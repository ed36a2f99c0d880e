"""The images that are compared: two of each job, and two of jobs for the scenes that FRAMEARRAY_SCENES holds."""

from dataclasses import dataclass
from pathlib import Path

from support.real_jobs import write_jobs
from support.scenes import scenes_folder

from bench.core.cases import JOBS, QUICK_RESOLUTION, with_resolution
from bench.core.results import ROOT, folder
from framearray_cli.job.job import Job
from framearray_cli.job.read import read_job

# Camera and light positions of the images, as shares of their paths.
PLACES = ((0.4, 0.5), (0.75, 0.2))
# Jobs of scenes by other people, see `tests/support/real_jobs.py`.
SCENES = ("cornell_box-lamp", "country_kitchen-sun", "modern_hall-lamp", "vr_gallery-lamp")


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """One image of a job: camera position c under light position l."""

    job: str
    c: int
    l: int

    @property
    def name(self) -> str:
        """In names of files and tables."""
        return f"{self.job}-c{self.c}-l{self.l}"


def known_jobs() -> list[str]:
    """The jobs of the project, and those of scenes that are there."""
    scenes = scenes_folder()
    return [*JOBS, *(name for name in SCENES if (scenes / name.rpartition("-")[0] / "camera.json").is_file())]


def job_file(name: str) -> Path:
    """The file of a job; those of scenes are written first."""
    if name in JOBS:
        return ROOT / "jobs" / f"{name}.toml"
    file = folder(False) / "truth-jobs" / f"{name}.toml"
    if not file.is_file():
        write_jobs(scenes_folder(), file.parent)
    return file


def job_of(name: str, quick: bool) -> Job:
    """A job, with smaller images for a quick run."""
    job = read_job(job_file(name))
    return with_resolution(job, QUICK_RESOLUTION) if quick else job


def places_of(name: str, quick: bool) -> list[Place]:
    """The images of a job that are compared."""
    job = job_of(name, quick)
    return [Place(job=name, c=int(c * job.camera.frames), l=int(l * job.light.frames)) for c, l in PLACES]
