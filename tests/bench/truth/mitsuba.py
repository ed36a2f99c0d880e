"""Path-traced pictures from Mitsuba 3, where it is installed: a job without obscurances.

The same triangles, interpolated normals, textures, mirrors, lights and background, one camera and one light position,
by Mitsuba's own `path` integrator. Beside it the part that the program does not approximate, light that comes directly
from a source or the background, by mirrors or not: it shows that both programs see the same scene.
"""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float32, Float64, Image
from framearray_cli.render.prepare import Prepared
from framearray_cli.scene.scene import Scene

from . import mitsubagloss as gloss
from .emitters import area_light, emitters_of, hidden_sides, past_lamps, radiance_of_materials
from .places import Place

COMPILED = "llvm_ad_rgb"  # variant of Mitsuba by LLVM
PASSES = 16  # independent ones, whose spread gives the error
ROULETTE = 16  # vertices before a path may end by chance; there is no other end


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Traced:
    """Pictures of one place, (PASSES, h, w, 3): all light, and that which comes directly from sources or background.

    Attributes:
        seconds: of tracing all light, compiling left out.
    """

    total: Float32
    light: Float32
    seconds: float

    def save(self, file: Path) -> None:
        """Keep them, half by half, with the standard errors of the means from the spread of all passes.

        The standard errors are of the mean over picture and channels.
        """
        halves = {name: halves_of(getattr(self, name)) for name in ("total", "light")}
        errors = {f"{name}_error": error_of_mean(getattr(self, name)) for name in ("total", "light")}
        errors["indirect_error"] = error_of_mean(self.total - self.light)
        np.savez(file, **halves, **errors)


def halves_of(passes: Float32) -> Float32:
    """The means of both halves of the passes."""
    found: Float32 = passes.reshape(2, -1, *passes.shape[1:]).mean(axis=1)
    return found


def error_of_mean(passes: Float32 | Float64) -> float:
    """The standard error of the mean over all passes, from their spread."""
    means = passes.reshape(len(passes), -1).mean(axis=1, dtype=np.float64)
    return float(means.std(ddof=1) / np.sqrt(len(means)))


def find_mitsuba() -> tuple[Any, str]:
    """Return Mitsuba, and the reason why it is of no use, or ""."""
    try:
        import mitsuba as mi
    except ImportError:
        return None, "Mitsuba is not installed (pip install mitsuba)"
    return mi, "" if COMPILED in mi.variants() else f"this Mitsuba has no variant {COMPILED}"


def unknown(scene: Scene) -> str:
    """What of a scene is not carried over, or ""."""
    if len(scene.colours):
        return "corner colours are not carried over"
    if (scene.alpha_texture >= 0).any() or (scene.alpha < scene.alpha_cutoff).any():
        return "alpha masks are not carried over"
    if (scene.specular_texture >= 0).any():
        return "textured mirrors are not carried over"
    if scene.has_glass or len(scene.tangents):
        return "neither glass nor normal maps are carried over"
    return ""


def pictures(mi: Any, prepared: Prepared, place: Place, samples: int) -> Traced:
    """Trace a place with a number of samples per pixel in all."""
    each = max(samples // PASSES, 1)
    mi.set_variant(COMPILED)
    dark, sensor = scene_of(mi, prepared, place, sky=False), sensor_of(mi, prepared, place.c)
    light = [direct_light(mi, dark, sensor, prepared, each, 1_000_000 + i) for i in range(PASSES)]
    lit, sensor = scene_of(mi, prepared, place, sky=True), sensor_of(mi, prepared, place.c)
    integrator = mi.load_dict({"type": "path", "max_depth": -1, "rr_depth": ROULETTE})
    total, spent = [], []
    for i in range(PASSES):
        started = time.perf_counter()
        found = mi.render(lit, integrator=integrator, sensor=sensor, spp=each, seed=i + 1)
        total.append(np.array(found, np.float32)[..., :3])
        spent.append(time.perf_counter() - started)
    seconds = PASSES * float(np.median(spent[1:]))  # the first compiles
    return Traced(total=np.stack(total), light=np.stack(light), seconds=seconds)


def sensor_of(mi: Any, prepared: Prepared, c: int, origin: Float64 | None = None) -> Any:
    """Eye c; a pixel's filter is its box."""
    width, height = prepared.job.camera.resolution
    matrix = prepared.eyes.world_from_camera[c]
    eye = np.zeros(3) if origin is None else prepared.eyes.position[c] - origin
    look = mi.ScalarTransform4f().look_at(
        origin=eye.tolist(), target=(eye - matrix[:3, 2]).tolist(), up=matrix[:3, 1].tolist()
    )
    film = {"type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "box"}}
    film |= {"pixel_format": "rgb", "component_format": "float32"}
    lens = {"fov": prepared.eyes.lenses[0].fov, "fov_axis": "y", "near_clip": 1e-3}
    return mi.load_dict({"type": "perspective", **lens, "to_world": look, "film": film})


def scene_of(mi: Any, prepared: Prepared, place: Place, sky: bool, origin: Float64 | None = None) -> Any:
    """The scene under the light position of a place, one mesh per material; its eye is the origin.

    Mitsuba starts rays 1500 units in the last place of the largest coordinate above a surface. About the middle of the
    stairs that is 3 mm, which misses the shadow of the carpet's edge; about the eye it is a third of that.

    Args:
        sky: whether the background shines.
        origin: another origin, for `sensor_of` too.
    """
    scene, origin = prepared.scene, prepared.eyes.position[place.c] if origin is None else origin
    table: dict[str, Any] = {"type": "scene"}
    radiance = radiance_of_materials(prepared, place.l)
    for m in np.unique(scene.material):
        table[f"mesh{m}"] = _mesh(mi, scene, int(m), origin - scene.centre, radiance.get(scene.material_names[m]))
    for s, source in enumerate(prepared.lights.sources):
        table |= emitters_of(mi, f"light{s}", source, place.l, origin)
    background = prepared.job.scene.background
    if sky and max(background) > 0:
        table["sky"] = {"type": "constant", "radiance": {"type": "rgb", "value": list(background)}}
    return mi.load_dict(table)


def _mesh(mi: Any, scene: Scene, m: int, origin: Float64, radiance: Float64 | None = None) -> Any:
    """The triangles of a material, from an origin in the scene's coordinates.

    Args:
        radiance: of the fronts of its triangles, which Mitsuba takes from interpolated normals where it has them.
    """
    chosen = scene.material == m
    n = int(chosen.sum())
    smooth = len(scene.normals) > 0 and radiance is None
    glossy = gloss.is_glossy(scene, m) and scene.gloss_texture[m] >= 0
    textured = bool(scene.reflectivity_texture[m] >= 0 or glossy)
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(_bsdf(mi, scene, m))
    if radiance is not None:
        properties["emitter"] = mi.load_dict(area_light(radiance))
    mesh = mi.Mesh(
        f"mesh{m}", vertex_count=3 * n, face_count=n, has_vertex_normals=smooth, has_vertex_texcoords=textured,
        props=properties,
    )  # fmt: skip
    params = mi.traverse(mesh)
    params["vertex_positions"] = (scene.corners[chosen] - origin).astype(np.float32).ravel()
    params["faces"] = np.arange(3 * n, dtype=np.uint32)
    if smooth:
        params["vertex_normals"] = np.ascontiguousarray(scene.normals[chosen]).ravel()
    if textured:
        downwards = scene.uvs[chosen] * np.float32([1, -1]) + np.float32([0, 1])
        params["vertex_texcoords"] = np.ascontiguousarray(downwards).ravel()
    params.update()
    return mesh


def _bsdf(mi: Any, scene: Scene, m: int) -> dict[str, Any]:
    """Diffuse and mirror part of a material, or its gloss, on both sides."""
    if gloss.is_glossy(scene, m):
        base = _reflectance(mi, scene, m, 1.0)
        if base["type"] == "rgb":
            base = gloss.bitmap(mi, np.array(base["value"])[None, None])
        return {"type": gloss.register(mi, mi.variant()), "base": base, "gloss": gloss.gloss_texture(mi, scene, m)}
    diffuse, mirror = float(scene.reflectivity[m].max()), float(scene.specular[m].max())
    share = mirror / (diffuse + mirror) if mirror else 0.0
    parts: list[dict[str, Any]] = []
    if share < 1:
        parts.append({"type": "diffuse", "reflectance": _reflectance(mi, scene, m, 1 / (1 - share))})
    if share > 0:
        tint = {"type": "rgb", "value": (scene.specular[m] / share).tolist()}
        parts.append({"type": "conductor", "material": "none", "specular_reflectance": tint})
    both = {"type": "blendbsdf", "weight": share, "first": parts[0], "second": parts[-1]}
    return {"type": "twosided", "bsdf": both if len(parts) == 2 else parts[0]}


def _reflectance(mi: Any, scene: Scene, m: int, scale: float) -> dict[str, Any]:
    factor = scene.reflectivity[m] * np.float32(scale)
    texture = int(scene.reflectivity_texture[m])
    if texture < 0:
        return {"type": "rgb", "value": factor.tolist()}
    first, width, height = scene.textures[texture]
    code = scene.texels[first : first + width * height, :3].reshape(height, width, 3) / 255.0
    linear = np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)
    return gloss.bitmap(mi, linear * factor)


def direct_light(mi: Any, scene: Any, sensor: Any, prepared: Prepared, samples: int, seed: int) -> Image:
    """Direct light of the sources and the background on the surfaces that the eye sees, directly or by mirrors."""
    import drjit as dr

    width, height = prepared.job.camera.resolution
    ray, sampler = eye_rays(mi, sensor, (width, height), samples, seed)
    context, background = mi.BSDFContext(), mi.Color3f(list(prepared.job.scene.background))
    found, through, active = mi.Color3f(0), mi.Color3f(1), mi.Bool(True)
    hidden = hidden_sides(prepared)
    depth = prepared.job.specular.depth if prepared.scene.has_mirrors else 0
    # no `minimum` and no roulette: older LLVMs cannot compile them
    for bounce in range(depth + 1):
        hit = past_lamps(scene, ray, active, hidden)
        found += dr.select(active & ~hit.is_valid(), through * background, 0)
        active &= hit.is_valid()
        bsdf = hit.bsdf(ray)
        towards, arriving = scene.sample_emitter_direction(hit, sampler.next_2d(), True, active)
        reflected = bsdf.eval(context, hit, hit.to_local(towards.d), active)
        found += dr.select(active, through * reflected * arriving, 0)
        if bounce < depth:
            step, weight = bsdf.sample(context, hit, sampler.next_1d(), sampler.next_2d(), active)
            active &= mi.has_flag(step.sampled_type, mi.BSDFFlags.DeltaReflection)
            through *= weight
            ray = hit.spawn_ray(hit.to_world(step.wo))
    dr.eval(found)
    sums = [dr.block_reduce(dr.ReduceOp.Add, channel, samples) for channel in (found.x, found.y, found.z)]
    dr.eval(*sums)
    return np.stack([np.array(channel, np.float32) for channel in sums], -1).reshape(height, width, 3) / samples


def eye_rays(mi: Any, sensor: Any, resolution: tuple[int, int], samples: int, seed: int) -> tuple[Any, Any]:
    """Rays through all pixels, those of a pixel in a row; and the sampler that chose them."""
    import drjit as dr

    width, height = resolution
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed, width * height * samples)
    pixel = dr.arange(mi.UInt32, width * height * samples) // samples
    corner = mi.Point2f(mi.Float(pixel % width), mi.Float(pixel // width))
    place = (corner + sampler.next_2d()) / mi.Point2f(width, height)
    ray, _ = sensor.sample_ray(0.0, 0.0, place, mi.Point2f(0.5, 0.5))
    return ray, sampler
