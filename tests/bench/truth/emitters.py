"""Sources of a job as Mitsuba's emitters; eyes see none of them but surfaces that shine and environments."""

from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.render.prepare import Prepared
from framearray_cli.scene.paths.lightpath import LightPath

# Mitsuba blends between texels. Of a map with each texel repeated it blends that much less.
REPEATED = 16


def area_light(radiance: Float64) -> dict[str, Any]:
    """An emitter for the front of a shape."""
    return {"type": "area", "radiance": {"type": "rgb", "value": radiance.tolist()}}


def emitters_of(mi: Any, name: str, source: LightPath, l: int, origin: Float64) -> dict[str, Any]:
    """The emitters of a source at light position l, by name; none of a mesh, which is part of the scene.

    Raises:
        ValueError: Mitsuba has nothing like it.
    """
    if source.emitter is not None or source.part_of is not None:  # suns are left in the map that they were cut from
        return {}
    if source.profile is not None or (source.kind == "directional" and source.size is not None):
        raise ValueError("neither measured lamps nor suns with a size are carried over")
    power = {"type": "rgb", "value": source.intensity[l].tolist()}
    if source.environment is not None:
        return {name: _map(mi, source, l)}
    if source.kind == "directional":
        return {name: {"type": "directional", "direction": source.vector[l].tolist(), "irradiance": power}}
    place = source.vector[l] - origin
    if source.panel is not None:
        return _panel(mi, name, source, l, place)
    if source.cone is not None:
        inner, outer = source.cone.angles_deg[l].tolist()
        if inner < outer:
            raise ValueError("only spots with a hard edge are carried over")
        axis = source.cone.axis[l]
        up = np.eye(3)[np.abs(axis).argmin()]
        look = mi.ScalarTransform4f().look_at(origin=place.tolist(), target=(place + axis).tolist(), up=up.tolist())
        angles = {"cutoff_angle": outer, "beam_width": 0.9999 * outer}
        return {name: {"type": "spot", "to_world": look, "intensity": power, **angles}}
    if source.size is not None and source.size[l] > 0:
        radius = float(source.size[l])
        ball = {"type": "sphere", "center": place.tolist(), "radius": radius, "bsdf": {"type": "null"}}
        return {name: {**ball, "emitter": area_light(source.intensity[l] / (np.pi * radius**2))}}
    return {name: {"type": "point", "position": place.tolist(), "intensity": power}}


def radiance_of_materials(prepared: Prepared, l: int) -> dict[str, Float64]:
    """The radiance of materials that shine at light position l.

    Raises:
        ValueError: a texture says how bright one is, or both its sides shine.
    """
    found = {}
    for source in prepared.lights.sources:
        if source.emitter is not None:
            if not source.emitter.flat or source.emitter.two_sided:
                raise ValueError("only meshes whose fronts have one radiance are carried over")
            found[source.emitter.material] = source.intensity[l]
    return found


def hidden_sides(prepared: Prepared) -> int:
    """How many sides of lamps an eye ray may meet that it shall not see."""
    panels = [source.panel for source in prepared.lights.sources if source.panel is not None]
    balls = [s for s in prepared.lights.sources if s.panel is None and s.kind == "point" and s.size is not None]
    return sum(1 + panel.two_sided for panel in panels) + 2 * len(balls)


def past_lamps(scene: Any, ray: Any, active: Any, sides: int) -> Any:
    """What a ray meets first but for lamps."""
    hit = scene.ray_intersect(ray, active)
    for _ in range(sides):
        ray.o[hit.emitter(scene) != None] = hit.spawn_ray(ray.d).o  # noqa: E711  # drjit compares arrays by !=
        hit = scene.ray_intersect(ray, active)
    return hit


def _panel(mi: Any, name: str, source: LightPath, l: int, place: Float64) -> dict[str, Any]:
    """The bright sides of a rectangle or disc, which let the rays of eyes through; see `past_lamps`."""
    panel = source.panel
    assert panel is not None
    (a, b), axis = (axes[l] for axes in panel.half_axes), panel.axis[l]
    sides = {}
    for side in (1, -1) if panel.two_sided else (1,):
        matrix = np.eye(4)
        matrix[:3] = np.stack([side * a, b, side * axis, place], axis=1)
        sides[f"{name}{'-front' if side > 0 else '-back'}"] = {
            "type": "disk" if panel.shape == "disc" else "rectangle",
            "to_world": mi.ScalarTransform4f(matrix.tolist()),
            "bsdf": {"type": "null"},
            "emitter": area_light(source.intensity[l] / panel.area[l]),
        }
    return sides


def _map(mi: Any, source: LightPath, l: int) -> dict[str, Any]:
    """An environment. Mitsuba's has the middle of the map along its z axis, and y up."""
    around = source.environment
    assert around is not None
    pixels = (around.panorama.pixels if around.maps is None else around.maps[l]) * around.factor[l]
    # its first row is straight up and its last one straight down: a row between two texels has the mean of both
    row = np.arange(REPEATED * len(pixels) + 1)
    below, above = np.minimum(row // REPEATED, len(pixels) - 1), np.maximum(row - 1, 0) // REPEATED
    pixels = ((pixels[below] + pixels[above]) / 2).repeat(REPEATED, axis=1)
    matrix = np.eye(4)
    middle, up = -source.vector[l], around.up
    matrix[:3, :3] = np.stack([np.cross(up, middle), up, middle], axis=1)
    return {
        "type": "envmap",
        "bitmap": mi.Bitmap(np.ascontiguousarray(pixels, np.float32)),
        "to_world": mi.ScalarTransform4f(matrix.tolist()),
    }
