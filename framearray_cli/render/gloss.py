"""What gloss does not go with."""

from framearray_cli.base.errors import JobError
from framearray_cli.job.job import Job
from framearray_cli.scene.scene import Scene


def require_plain_shadows(job: Job, scene: Scene) -> None:
    """Refuse corrected shadows on glossy surfaces: what those keep of a light is whether it reached them.

    Raises:
        JobError: the job asks for both.
    """
    if scene.is_glossy and job.samples.shadow_unbiased and job.samples.shadow_step > 1:
        problem = 'expected false with scene.surfaces = "file" and glossy materials, got true'
        raise JobError(job.file or job.name, [f"samples.shadow_unbiased: {problem}"])
