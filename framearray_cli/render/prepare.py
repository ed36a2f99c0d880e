"""Prepare a render: scene, eyes, lights, ambient light, and the setup of frames."""

import time
from dataclasses import dataclass, field, replace

import numpy as np

from framearray_cli.base.arrays import Rgb
from framearray_cli.base.memory import available_cores, resident_memory
from framearray_cli.engine.embree.embreescene import EmbreeScene
from framearray_cli.engine.frames.passes import frame_hits
from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.engine.hits.hits import World
from framearray_cli.engine.images.denoise import require_denoiser
from framearray_cli.engine.inputs.cameras import Cameras, cameras
from framearray_cli.engine.inputs.emitters import Glow, emitters, glow, glowing
from framearray_cli.engine.inputs.gloss import Glossy, glossy
from framearray_cli.engine.inputs.lights import LightArrays, light_arrays
from framearray_cli.engine.inputs.marks import marks_of
from framearray_cli.engine.inputs.mips import mips
from framearray_cli.engine.inputs.panes import pane_arrays
from framearray_cli.engine.inputs.random import lattice_steps
from framearray_cli.engine.inputs.surfaces import Relief, Surfaces, near_depth, relief, surfaces
from framearray_cli.engine.kernels.clock import compile_clock
from framearray_cli.engine.terms.accuracy import Accuracy
from framearray_cli.engine.terms.ambient.estimate import MIN_WALKS, Ambient
from framearray_cli.engine.terms.ambient.fitted import ObscuranceCurve, ambient_by_fit
from framearray_cli.engine.terms.ambient.from_eyes import EyeWalks, ambient_by_eye, fixed_ambient
from framearray_cli.engine.terms.cells.build import CellWork, build_cells
from framearray_cli.engine.terms.cells.exact import coloured, no_cells
from framearray_cli.engine.terms.cells.residual import compare_with_paths
from framearray_cli.engine.terms.cells.samples import SampleWalks
from framearray_cli.engine.terms.falloff import FALLOFFS
from framearray_cli.engine.terms.obscurance import ObscuranceSettings
from framearray_cli.job.job import Job
from framearray_cli.scene.paths.paths import Eyes, Lights, eyes, lights
from framearray_cli.scene.scene import Scene, load_scene

from .ambient_groups import name_groups
from .cell_size import least_edge, require_cell_size
from .cells import Share, SolvedCells, solve_alone
from .default_range import with_range
from .gloss import require_plain_shadows
from .halves import halves_of
from .shining import with_emission
from .sun_study import sun_study

# Least memory granted to the scene; a limit that leaves less is refused later, when the needs of frames are known.
LEAST_SCENE_MEMORY = 64 * 2**20


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Prepared:
    """A job whose inputs were read and checked; no ray was cast yet. See `prepared_from`.

    Attributes:
        still: the camera never moves; its hits are found once and serve all frames [FA section 3.2].
        held: bytes that the program held when all this was read.
    """

    job: Job
    scene: Scene
    eyes: Eyes
    lights: Lights
    light_arrays: LightArrays
    surfaces: Surfaces
    relief: Relief
    glossy: Glossy
    glow: Glow
    still: bool
    held: int = field(default_factory=resident_memory)

    @property
    def n_cameras(self) -> int:
        """N_c."""
        return self.eyes.n

    @property
    def n_lights(self) -> int:
        """N_l."""
        return self.lights.n

    def world(self, embree: EmbreeScene) -> World:
        """The scene as kernels read it, without smaller copies of textures."""
        panes = pane_arrays(self.scene, embree.panes, bends=self.job.specular.depth > 0)
        return World(self.surfaces, embree.tracer, self.relief, panes=panes)

    @property
    def threads(self) -> int:
        """Threads of the render: the job's, else one per core that this process may use."""
        return self.job.render.threads or available_cores()


def prepare(job: Job) -> Prepared:
    """Read the scene of a job and place its eyes and lights.

    Raises:
        JobError: a path is invalid, a material cannot shine, or cells are too small; see `prepared_from`.
        SceneError: the scene cannot be read or rendered.
    """
    if job.denoise.obscurance:
        require_denoiser()
    job_eyes, job_lights = eyes(job), lights(job)
    shining, file = {path.emitter.material for path in job_lights.sources if path.emitter}, job.scene
    as_file, memory = file.surfaces == "file", _scene_memory(job)
    all_uvs = job.output.marks["uv"]
    scene = load_scene(file.file, file.materials, file.folders, memory, shining, as_file=as_file, all_uvs=all_uvs)
    return prepared_from(job, scene, job_eyes, job_lights)


def prepared_from(job: Job, scene: Scene, eyes: Eyes, lights: Lights) -> Prepared:
    """Put together a job, its scene, and the eyes and lights to render.

    Raises:
        JobError: as `with_emission`, `require_plain_shadows` and `require_cell_size`.
    """
    job, scene = with_range(job, scene, eyes)
    lights = with_emission(job, lights, scene)
    require_plain_shadows(job, scene)
    require_cell_size(job, scene)
    arrays, of_scene = light_arrays(lights, scene.centre, emitters(lights, scene)), surfaces(scene)
    seen = glow(scene, lights, as_file=job.scene.surfaces == "file")
    return Prepared(
        job=job,
        scene=scene,
        eyes=eyes,
        lights=lights,
        light_arrays=coloured(arrays) if job.indirect.exact or scene.has_glass else arrays,
        surfaces=of_scene,
        relief=relief(scene, of_scene),
        glossy=glossy(scene, of_scene, glowing(seen)),
        glow=seen,
        still=eyes.at_rest,
    )


def _scene_memory(job: Job) -> int | None:
    """Return the bytes that reading the scene may take: the rest of the job's limit."""
    limit = job.render.memory
    return None if limit is None else max(limit - resident_memory(), LEAST_SCENE_MEMORY)


def open_embree(prepared: Prepared) -> EmbreeScene:
    """Build the acceleration structure of a prepared job; close it after use."""
    return EmbreeScene(prepared.scene)


def plan_work(
    prepared: Prepared, embree: EmbreeScene, *, compare: bool = True, share: Share = solve_alone
) -> tuple[FrameSetup, Ambient]:
    """Estimate the ambient light and build the setup of all frames.

    Args:
        compare: whether to note how far light from cells is from that of paths.
        share: has cells solved, or finds those that another run solved.
    """
    job, background = prepared.job, np.array(prepared.job.scene.background, np.float32)
    ambient = name_groups(_ambient(prepared, embree), prepared.lights)
    setup = frame_setup(prepared, embree, ambient.reflectivity)
    if job.indirect.exact:
        return replace(setup, cells=no_cells(setup.lights, background), exact=True), ambient
    if job.indirect.method != "obscurance":
        solved = share(lambda: _solve_cells(prepared, embree, setup, compare=compare))
        notes = (*ambient.notes, *((solved.note,) if solved.note else ()))
        local = job.indirect.method == "local"
        setup = replace(setup, cells=solved.cells, smooth=0 if local else job.indirect.filter, local=local)
        return setup, replace(ambient, notes=notes, accuracy=solved.accuracy, shared_s=solved.shared_s)
    return setup, ambient


def frame_setup(prepared: Prepared, embree: EmbreeScene, reflectivity: Rgb) -> FrameSetup:
    """Build the setup of all frames, with obscurances for indirect light.

    Args:
        reflectivity: (3,) the average of the scene's surfaces.
    """
    job, scene, n_r = prepared.job, prepared.scene, prepared.job.n_r
    cams, background = eye_cameras(prepared), np.array(job.scene.background, np.float32)
    if prepared.still:  # one frame, with the hits that its whole window would have
        cams = cams.at(slice(1))
    step_x, step_y = lattice_steps(job.samples.obscurance)
    mirrors = (scene.has_mirrors or scene.has_glass) and job.specular.depth > 0
    return FrameSetup(
        cams=cams,
        world=prepared.world(embree)._replace(
            mips=mips(scene, prepared.surfaces, 1 / (cams.focal * max(job.hits * (2 * n_r + 1), 1.0) ** 0.5))
        ),
        lights=prepared.light_arrays,
        kept=range(prepared.n_lights),
        obscurance=ObscuranceSettings(
            d_max=job.d_max,
            falloff=FALLOFFS[job.obscurance.falloff],
            tau=job.obscurance.tau,
            n_rays=job.samples.obscurance,
            step_x=step_x,
            step_y=step_y,
            coherent=job.reuse.weights == "area",  # other jobs keep their images, to the last bit
            sky=job.obscurance.outside == "background",
            average=reflectivity,
            background=background,
        ),
        seed=job.seed,
        n_r=0 if prepared.still else n_r,
        per_pixel=frame_hits(len(cams.position), n_r, job.hits),
        mirror_hits=job.specular.hits if mirrors and scene.has_mirrors else 0,
        depth=job.specular.depth if mirrors else 0,
        balance=job.reuse.weights != "average" and not prepared.still,
        area=job.reuse.weights == "area",
        background=background,
        planes=prepared.lights.planes,
        shadow_step=1 if scene.has_glass else job.samples.shadow_step,
        shadow_unbiased=job.samples.shadow_unbiased,
        layers=job.output.layers,
        denoise=job.denoise.obscurance,
        halves=halves_of(job, still=prepared.still),
        glossy=prepared.glossy,
        glow=prepared.glow,
        lobes=scene.is_glossy and job.specular.depth > 0,
        sun=sun_study(job, prepared.lights) if job.sun_days else None,
        marks=marks_of(scene, **job.output.marks),
        alpha=bool(job.output.alpha),
    )


def _solve_cells(prepared: Prepared, embree: EmbreeScene, setup: FrameSetup, *, compare: bool) -> SolvedCells:
    """Solve the light of all cells, and note how far it is from that of paths."""
    job = prepared.job
    walks = SampleWalks(
        cams=eye_cameras(prepared),
        seed=job.seed,
        world=prepared.world(embree),
        lights=prepared.light_arrays,
        depth=setup.depth,
    )
    work = CellWork(
        walks=walks,
        background=np.array(job.scene.background, np.float32),
        count=job.indirect.samples,
        edge=job.indirect.cell,
        threads=prepared.threads,
        local=setup.obscurance if job.indirect.method == "local" else None,
        least_edge=least_edge(prepared.scene),
    )
    built = build_cells(work)
    started = time.perf_counter()
    with compile_clock() as clock:
        eyes, found = _eye_walks(prepared, embree), None
        if compare and work.local is None:
            found = compare_with_paths(built.cells, eyes, setup.obscurance, setup.depth, prepared.threads)
    shared_s = built.shared_s + time.perf_counter() - started - clock.seconds
    accuracy, note = (found, found.note) if isinstance(found, Accuracy) else (None, found or "")
    return SolvedCells(cells=built.cells, note=note, accuracy=accuracy, shared_s=shared_s)


def eye_cameras(prepared: Prepared) -> Cameras:
    """Return all eyes as kernels take them; an eye sees nothing nearer than the ray offset from surfaces."""
    near = near_depth(prepared.surfaces)
    return cameras(prepared.eyes, prepared.job.camera.resolution, prepared.scene.centre, near)


def _ambient(prepared: Prepared, embree: EmbreeScene) -> Ambient:
    job, walks = prepared.job, _eye_walks(prepared, embree)
    if job.indirect.method != "obscurance":
        # Images take none; the average reflectivity stands for what rays of W miss.
        n = prepared.n_lights
        few = replace(walks, paths=MIN_WALKS, lights=walks.lights.at([0]))
        found = fixed_ambient(few, np.zeros(3, np.float32), prepared.threads)
        return replace(found, intensity=np.zeros((n, 3), np.float32), standard_error=np.zeros(n), paths=0)
    if job.ambient.method == "fit":
        ways, sky = job.obscurance, job.obscurance.outside == "background"
        curve = ObscuranceCurve(d_max=job.d_max, falloff=FALLOFFS[ways.falloff], tau=ways.tau, sky=sky)
        return ambient_by_fit(walks, curve, prepared.threads)
    if job.ambient.intensity is not None:
        return fixed_ambient(walks, np.array(job.ambient.intensity, np.float32), prepared.threads)
    return ambient_by_eye(walks, prepared.threads)


def _eye_walks(prepared: Prepared, embree: EmbreeScene) -> EyeWalks:
    """Return where walks from the eyes start and what they meet."""
    job = prepared.job
    return EyeWalks(
        cams=eye_cameras(prepared),
        seed=job.seed,
        paths=job.ambient.paths,
        world=prepared.world(embree),
        lights=prepared.light_arrays,
        background=np.array(job.scene.background, np.float32),
    )
