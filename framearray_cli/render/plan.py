"""Plan a render: ambient light or cells, and the setup of frames."""

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from framearray_cli.base.arrays import Rgb
from framearray_cli.engine.embree.embreescene import EmbreeScene
from framearray_cli.engine.features.indirect import CellLight, Obscurances, PathLight
from framearray_cli.engine.frames.passes import frames_per_turn
from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.engine.hits.row import BY_SAMPLE
from framearray_cli.engine.inputs.cameras import Cameras, cameras
from framearray_cli.engine.inputs.mips import mips
from framearray_cli.engine.inputs.random import lattice_steps
from framearray_cli.engine.inputs.surfaces import near_depth
from framearray_cli.engine.kernels.clock import compile_clock
from framearray_cli.engine.terms.ambient.from_eyes import (
    EyeWalks,
    ambient_by_eye,
    fixed_ambient,
)
from framearray_cli.engine.terms.ambient.intensity import MIN_WALKS, Accuracy, Ambient
from framearray_cli.engine.terms.cells.exact import compare_with_paths
from framearray_cli.engine.terms.cells.samples import SampleWalks
from framearray_cli.engine.terms.cells.solution import CellWork, build_cells
from framearray_cli.engine.terms.obscurance import FALLOFFS, ObscuranceSettings
from framearray_cli.job.job import Job
from framearray_cli.scene.paths.paths import Lights, Plane

from .cells import Share, SolvedCells, least_edge
from .prepare import Prepared

# Least native hits per pixel that are sampled in two halves.
FEWEST_SPLIT = 4


def plan_work(
    prepared: Prepared, embree: EmbreeScene, *, compare: bool = True, share: Share = lambda solve: solve()
) -> tuple[FrameSetup, Ambient]:
    """Estimate the ambient light and build the setup of all frames.

    Args:
        compare: True to note how far light from cells is from light of paths.
        share: has cells solved, or finds those that another run solved.
    """
    job = prepared.job
    ambient = name_groups(_ambient(prepared, embree), prepared.lights)
    setup = frame_setup(prepared, embree, ambient.reflectivity)
    if job.indirect.exact:
        return replace(setup, indirect=PathLight(setup.indirect.settings)), ambient
    if job.indirect.method != "obscurance":
        solved = share(lambda: _solve_cells(prepared, embree, setup, compare=compare))
        notes = (*ambient.notes, *((solved.note,) if solved.note else ()))
        light = CellLight(settings=setup.indirect.settings, cells=solved.cells, smooth=job.indirect.filter)
        ambient = replace(ambient, notes=notes, accuracy=solved.accuracy, shared_s=solved.shared_s)
        return replace(setup, indirect=light), ambient
    return setup, ambient


def frame_setup(prepared: Prepared, embree: EmbreeScene, reflectivity: Rgb) -> FrameSetup:
    """Build the setup of all frames, with obscurances for indirect light.

    Args:
        reflectivity: (3,) the average of the scene's surfaces.
    """
    job, scene, n_r = prepared.job, prepared.scene, prepared.job.n_r
    cams, world = eye_cameras(prepared), prepared.world(embree)
    if prepared.still:  # one frame, with the hits that its whole window would have
        cams = cams.at(slice(1))
    blur = 1 / (cams.focal * max(job.hits * (2 * n_r + 1), 1.0) ** 0.5)
    mirrors = (scene.has_mirrors or scene.has_glass) and job.specular.depth > 0
    return FrameSetup(
        cams=cams,
        world=world._replace(mips=mips(scene, prepared.surfaces, blur)),
        lights=prepared.light_arrays,
        planes=prepared.lights.planes,
        background=np.array(job.scene.background, np.float32),
        seed=job.seed,
        n_r=0 if prepared.still else n_r,
        weights=job.reuse.weights,
        per_pixel=np.full(len(cams.position), job.hits * (2 * n_r + 1 if prepared.still else 1), np.float64),
        mirror_hits=job.specular.hits if mirrors and scene.has_mirrors else 0,
        depth=job.specular.depth if mirrors else 0,
        halves=_halves(job, still=prepared.still),
        indirect=Obscurances(_obscurance(job, reflectivity)),
        features=prepared.features,
    )


def _obscurance(job: Job, reflectivity: Rgb) -> ObscuranceSettings:
    """Return the settings of the rays of W."""
    step_x, step_y = lattice_steps(job.samples.obscurance)
    return ObscuranceSettings(
        d_max=job.d_max,
        falloff=FALLOFFS[job.obscurance.falloff],
        tau=job.obscurance.tau,
        n_rays=job.samples.obscurance,
        step_x=step_x,
        step_y=step_y,
        coherent=job.reuse.weights == "area",  # other jobs keep their images, to the last bit
        sky=job.obscurance.outside == "background",
        average=reflectivity,
        background=np.array(job.scene.background, np.float32),
    )


def _halves(job: Job, *, still: bool) -> int:
    """Return how the job's hits are split into two halves; see `FrameSetup.halves`.

    Frames see a place differently, so halves of frames differ by more than noise, which matters where noise is low.
    Halves of one or two samples are spread less evenly over a pixel than all these samples.
    """
    if not job.samples.halves:
        return 0
    by_sample = job.hits >= FEWEST_SPLIT or still or job.n_r == 0
    return BY_SAMPLE if by_sample else frames_per_turn(job.hits)


def _solve_cells(prepared: Prepared, embree: EmbreeScene, setup: FrameSetup, *, compare: bool) -> SolvedCells:
    """Solve the light of all cells, and note its difference from paths."""
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
        least_edge=least_edge(prepared.scene),
    )
    built = build_cells(work)
    started = time.perf_counter()
    with compile_clock() as clock:
        eyes, found = _eye_walks(prepared, embree), None
        if compare:
            given = setup.indirect.settings, setup.depth, job.indirect.samples, prepared.threads
            found = compare_with_paths(built.cells, eyes, *given)
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


def image_ambient(ambient: Ambient, lights: Lights) -> Ambient:
    """Return the I_A that images are composed with; with groups, 0 for all planes but R W, and 1 there.

    An array with groups has the I_A of each group in its manifest, and adds it when a picture is made.
    """
    if not lights.groups:
        return ambient
    intensity = np.zeros_like(ambient.intensity)
    intensity[lights.planes.index(Plane.INDIRECT)] = 1.0
    return replace(ambient, intensity=intensity)


def ambient_at(ambient: Ambient, positions: Sequence[int]) -> Ambient:
    """Return the estimate at some light positions."""
    rows = list(positions)
    return replace(ambient, intensity=ambient.intensity[rows], standard_error=ambient.standard_error[rows])


def name_groups(ambient: Ambient, lights: Lights) -> Ambient:
    """Return the same estimate with the group of the light position in its notes."""
    l = int(ambient.standard_error.argmax())
    group = next((group for group in lights.groups if l in group.positions), None)
    if group is None:
        return ambient
    name = f"at light {l - group.positions.start} of {group.name} "
    return replace(ambient, notes=tuple(note.replace(f"at light {l} ", name) for note in ambient.notes))
