"""Prepare a render: read the scene, place eyes and lights, and check what a job asks of them."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from difflib import SequenceMatcher
from functools import partial

import numpy as np

from framearray_cli.base.arrays import Corners, Float64
from framearray_cli.base.errors import JobError
from framearray_cli.base.forms.table import changed
from framearray_cli.base.forms.words import shown
from framearray_cli.base.memory import available_cores, resident_memory
from framearray_cli.base.units import digits
from framearray_cli.engine.embree.embreescene import EmbreeScene
from framearray_cli.engine.frames.setup import Feature
from framearray_cli.engine.hits.hits import World
from framearray_cli.engine.inputs.emitters import Glow, emitters, glow, glowing
from framearray_cli.engine.inputs.gloss import Glossy, glossy
from framearray_cli.engine.inputs.lights import LightArrays, light_arrays
from framearray_cli.engine.inputs.panes import Sight, pane_arrays
from framearray_cli.engine.inputs.surfaces import Relief, Surfaces, relief, surfaces
from framearray_cli.engine.terms.cells.exact import coloured
from framearray_cli.job.job import Job
from framearray_cli.scene.files.model import join_names
from framearray_cli.scene.paths.lightpath import LightPath
from framearray_cli.scene.paths.paths import Eyes, Lights, eyes, lights
from framearray_cli.scene.scene import Scene, load_scene

from .cells import extent, require_cell_size
from .features import features_of

NAMES_IN_A_MESSAGE = 6
# Least memory granted to the scene; a limit that leaves less is refused later, when the needs of frames are known.
LEAST_SCENE_MEMORY = 64 * 2**20


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Prepared:
    """A job whose inputs were read and checked; no ray was cast yet. See `prepared_from`.

    Attributes:
        still: the camera never moves; its hits are found once and serve all frames [FA section 3.2].
        held: bytes that the program held when all this was read.
        features: of the job, which follow from the rest.
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
    features: tuple[Feature, ...] = field(init=False)

    def __post_init__(self) -> None:
        found = features_of(self.job, self.scene, self.lights, self.light_arrays.emitters, self.glossy, self.glow)
        object.__setattr__(self, "features", found)

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
        return World(self.surfaces, Sight(embree.tracer, panes), self.relief, looking=embree.eyes)

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
    job_eyes, job_lights = eyes(job), lights(job)
    shining, file = {path.emitter.material for path in job_lights.sources if path.emitter}, job.scene
    as_file, all_uvs, limit = file.surfaces == "file", job.output.aov["uv"], job.render.memory
    memory = None if limit is None else max(limit - resident_memory(), LEAST_SCENE_MEMORY)
    where = file.file, file.materials, file.folders
    hide = file.back_faces == "hide"
    scene = load_scene(*where, memory, shining, as_file=as_file, all_uvs=all_uvs, time=file.time, hide_backs=hide)
    return prepared_from(job, scene, job_eyes, job_lights)


def prepared_from(job: Job, scene: Scene, eyes: Eyes, lights: Lights) -> Prepared:
    """Put together a job, its scene, and the eyes and lights to render.

    Raises:
        JobError: as `with_emission` and `require_cell_size`.
    """
    job, scene = with_range(job, scene, eyes)
    lights = with_emission(job, lights, scene)
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


def open_embree(prepared: Prepared) -> EmbreeScene:
    """Build the acceleration structure of a prepared job; close it after use."""
    return EmbreeScene(prepared.scene, hide_backs=prepared.job.scene.back_faces == "hide")


def with_emission(job: Job, lights: Lights, scene: Scene) -> Lights:
    """Return the lights with the radiance of all meshes, where the scene file says what their materials emit.

    Raises:
        JobError: a material is missing, has no triangles or emits nothing.
    """
    if all(source.emitter is None for source in lights.sources):
        return lights
    if problems := list(_problems(lights, scene)):
        raise JobError(job.file or job.name, problems)
    return replace(lights, sources=tuple(_absolute(source, scene) for source in lights.sources))


def _absolute(source: LightPath, scene: Scene) -> LightPath:
    """Multiply the intensity of a mesh by the emission of its material."""
    if source.emitter is None or source.emitter.absolute:
        return source
    emission = scene.emission[_rows(source.emitter.material, scene)].max(axis=0).astype(np.float64)
    return replace(source, intensity=source.intensity * emission, emitter=replace(source.emitter, absolute=True))


def _rows(name: str, scene: Scene) -> list[int]:
    """The materials of a name; a mesh without texture coordinates has one of its own."""
    return [m for m, known in enumerate(scene.material_names) if known == name]


def _problems(lights: Lights, scene: Scene) -> Iterator[str]:
    """Say what is wrong with the materials of all meshes."""
    first: dict[str, int] = {}
    used = set(np.unique(scene.material).tolist())
    for s, source in enumerate(lights.sources):
        if (emitter := source.emitter) is None:
            continue
        name, place = emitter.material, f"light.sources[{s}].material"
        rows = _rows(name, scene)
        if not rows:
            likeness = partial(SequenceMatcher, None, name.lower())
            known = sorted(set(scene.material_names), key=lambda other: -likeness(other.lower()).ratio())
            yield (
                f"{place}: expected a material of the scene, got {shown(name)}; it has "
                f"{join_names(known, NAMES_IN_A_MESSAGE)}"
            )
        elif not used.intersection(rows):
            yield f"{place}: expected a material that some triangle of the scene has, got {shown(name)}, which has none"
        elif not emitter.absolute and not (scene.emission[rows] > 0).any():
            yield (
                f"{place}: expected a material that emits light, got {shown(name)}, whose emission in the scene file "
                "is black; give `radiance` in the keys of the source"
            )
        if name in first:
            yield f"{place}: expected a material that no other source has, got the one of light.sources[{first[name]}]"
        first.setdefault(name, s)


ROOM_RANGE, THING_RANGE = 0.5, 0.2  # d_max over the free height in a room, and over the largest extent of a thing
MOST_EYES = 16  # whose free height is measured
DIGITS = 2  # of the range; a rounded value is easier to repeat in a job


def with_range(job: Job, scene: Scene, eyes: Eyes) -> tuple[Job, Scene]:
    """Give a job without `obscurance.range` a range that suits the scene.

    Returns:
        The job with the range; the scene with a note on the choice, if images depend on it.
    """
    if job.obscurance.range is not None:
        return job, scene
    value, reason = default_range(scene, eyes, up=2 if job.scene.up == "z" else 1)
    new = changed(job, obscurance=changed(job.obscurance, range=value))
    if job.indirect.method != "obscurance":
        return new, scene
    note = f"obscurance.range: {value:g} scene units, {reason}"
    return new, replace(scene, report=replace(scene.report, notes=(*scene.report.notes, note)))


def default_range(scene: Scene, eyes: Eyes, up: int) -> tuple[float, str]:
    """Choose d_max, in scene units, and say why.

    Args:
        up: the axis that points up.
    """
    rows = np.unique(np.linspace(0, eyes.n - 1, MOST_EYES).astype(int))
    points = eyes.world_from_camera[rows, :3, 3] - scene.centre
    heights = free_heights(scene.corners, points, up)
    if 2 * np.isfinite(heights).sum() > len(heights):
        height = float(np.median(heights[np.isfinite(heights)]))
        return _rounded(ROOM_RANGE * height), f"half the free height of {digits(height, DIGITS)} at the cameras"
    size = extent(scene)
    return _rounded(THING_RANGE * size), f"a fifth of the scene's size of {digits(size, DIGITS)}"


def free_heights(corners: Corners, points: Float64, up: int) -> Float64:
    """Distances from the first surface below each point to the first above it, (n,); infinite without one of them.

    Args:
        corners: (m, 3, 3) triangles.
        points: (n, 3) in the same coordinates.
        up: the axis that points up.
    """
    across = [axis for axis in range(3) if axis != up]
    low, high = corners[:, :, across].min(axis=1), corners[:, :, across].max(axis=1)
    found = np.full(len(points), np.inf)
    for i, point in enumerate(points):
        flat = point[across]
        near = corners[((low <= flat) & (flat <= high)).all(axis=1)].astype(np.float64)
        a, b, c = (near[:, k, across] - flat for k in range(3))
        areas = np.stack([_cross(b, c), _cross(c, a), _cross(a, b)])  # barycentric, times twice the area
        total = areas.sum(axis=0)
        inside = (total != 0) & ((areas >= 0).all(axis=0) | (areas <= 0).all(axis=0))
        levels = (areas.T[inside] * near[inside][:, :, up]).sum(axis=1) / total[inside] - point[up]
        if (levels > 0).any() and (levels < 0).any():
            found[i] = levels[levels > 0].min() - levels[levels < 0].max()
    return found


def _cross(a: Float64, b: Float64) -> Float64:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def _rounded(length: float) -> float:
    return float(f"{length:.{DIGITS}g}")
