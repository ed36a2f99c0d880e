"""Cameras and lights of a USD file, and where they are at any time.

Strengths as the schemas of UsdLux define them: L = intensity x 2^exposure x color is radiance. `normalize` divides it
by the area of the light in the world, or of the sky that a distant light covers, so that its power stays when its size
changes. Only places change over time; the first frame gives lenses, strengths and sizes.
"""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.base.colour import black_body

from ..assets import Assets
from ..model import Notes, rgb3
from ..staging import Stage, StageBuilder, StageCamera, StageLens, StageLight
from .usdcore import matrix, opened, read_later, scene_time, usd

LIGHTS = ("SphereLight", "DiskLight", "RectLight", "CylinderLight", "DistantLight")
DOMES = ("DomeLight", "DomeLight_1")
COLDEST, HOTTEST = 1000.0, 10000.0  # kelvin, the range of the schema
WHITE = 6500.0  # kelvin, the default of the schema


def visible_prims(stage: Any, kinds: tuple[str, ...], time: Any) -> list[Any]:
    """The prims of some types that are visible, and all above them, in the order of the stage."""
    library = usd()
    prims = library.Usd.PrimRange.Stage(stage, library.Usd.TraverseInstanceProxies())
    chosen = (prim for prim in prims if prim.GetTypeName() in kinds)
    return [prim for prim in chosen if library.UsdGeom.Imageable(prim).ComputeVisibility(time) != "invisible"]


def count_lights(stage: Any) -> int:
    """The number of lights."""
    return len(visible_prims(stage, LIGHTS + DOMES, scene_time(stage)))


def radiance(prim: Any, time: Any) -> Float64:
    """(3,) intensity, exposure, colour and temperature together."""
    api = usd().UsdLux.LightAPI(prim)
    exposure = float(api.GetExposureAttr().Get(time) or 0.0)
    found = np.array(api.GetColorAttr().Get(time) or (1.0, 1.0, 1.0), np.float64)
    found = found * float(api.GetIntensityAttr().Get(time) or 0.0) * 2.0 ** min(max(exposure, -99.0), 99.0)
    if api.GetEnableColorTemperatureAttr().Get(time):
        kelvin = float(api.GetColorTemperatureAttr().Get(time) or WHITE)
        found = found * np.array(black_body(min(max(kelvin, COLDEST), HOTTEST)))
    return np.where(np.isfinite(found), np.maximum(found, 0.0), 0.0)


def read_light(prim: Any, node: int, world: Float64, time: Any, stage: StageBuilder) -> StageLight | None:
    """Read a light, or note why it cannot be used.

    Args:
        node: its number in the motion of the stage.
        world: (4, 4) its place in the world.
    """
    name, kind = prim.GetName(), str(prim.GetTypeName())
    shines = radiance(prim, time)
    normal = bool(usd().UsdLux.LightAPI(prim).GetNormalizeAttr().Get(time))
    x, y, z = (float(np.linalg.norm(world[:3, k])) for k in range(3))
    _note(prim, name, stage)

    def value(key: str, default: float) -> float:
        found = prim.GetAttribute(f"inputs:{key}").Get(time)
        return default if found is None or not math.isfinite(found) else abs(float(found))

    if kind == "DistantLight":
        angle = min(value("angle", 0.53), 180.0)
        sky = math.pi * math.sin(math.radians(angle) / 2) ** 2
        irradiance = shines if normal or sky == 0 else shines * sky
        return _light(name, node, "directional", irradiance, angle_deg=angle if angle <= 90 else 90.0)
    if kind == "RectLight":
        width, height = value("width", 1.0) * x, value("height", 1.0) * y
        if not width * height > 0:
            stage.note_light(name, "has no area and is left out")
            return None
        return _light(name, node, "rect", shines / (width * height if normal else 1.0), size=(width, height))
    radius = value("radius", 0.5) * (x + y) / 2
    if kind == "DiskLight":
        if not radius > 0:
            stage.note_light(name, "has no area and is left out")
            return None
        return _light(name, node, "disc", shines / (math.pi * radius**2 if normal else 1.0), radius=radius)
    if kind == "CylinderLight":
        radius, length = value("radius", 0.5) * (y + z) / 2, value("length", 1.0) * x
        stage.note_light(name, "the cylinder is taken as a sphere of its power")
        side = math.pi / 2 * radius * length  # radiance -> mean radiant intensity of its side
        return _light(name, node, "point", shines * (0.25 if normal else side), radius=radius)
    radius = value("radius", 0.5) * (x + y + z) / 3
    strength = shines * (0.25 if normal else math.pi * radius**2)
    return _shaped(prim, name, node, strength, radius, time, stage)


def _light(name: str, node: int, kind: Any, strength: Float64, **more: Any) -> StageLight:
    return StageLight(name=name, node=node, kind=kind, intensity=rgb3(strength), schema="UsdLux", **more)


def _shaped(
    prim: Any, name: str, node: int, strength: Float64, radius: float, time: Any, stage: StageBuilder
) -> StageLight:
    """A sphere, with a cone if it has one."""
    shaping = usd().UsdLux.ShapingAPI(prim)
    angle = shaping.GetShapingConeAngleAttr()
    outer = float(angle.Get(time)) if angle and angle.HasAuthoredValue() else 180.0
    if outer > 90:
        if outer < 180:
            stage.note_light(name, f"its cone of {outer:g} degrees is left out, as spots end at 90")
        return _light(name, node, "point", strength, radius=radius)
    soft = float(shaping.GetShapingConeSoftnessAttr().Get(time) or 0.0)
    return _light(name, node, "spot", strength, cone_deg=cone(outer, min(max(soft, 0.0), 1.0)), radius=radius)


def cone(outer: float, softness: float) -> tuple[float, float]:
    """Angles of a spot, degrees.

    The edge of UsdLux is t^2 (3 - 2 t), and here t^2 in the cosine: with the inner cosine at 3/4 of the way from the
    outer one to UsdLux's, both let the same light through, nearly.
    """
    end, start = math.cos(math.radians(outer)), math.cos(math.radians(outer * (1.0 - softness)))
    return math.degrees(math.acos(min(0.75 * start + 0.25 * end, 1.0))), outer


def _note(prim: Any, name: str, stage: StageBuilder) -> None:
    """Note the parts of a light that are left out."""
    shaping = usd().UsdLux.ShapingAPI(prim)
    focus = shaping.GetShapingFocusAttr()
    if focus and focus.HasAuthoredValue() and focus.Get():
        stage.note_light(name, "its focus is left out")
    angle = shaping.GetShapingConeAngleAttr()
    if prim.GetTypeName() != "SphereLight" and angle and angle.HasAuthoredValue() and angle.Get() < 90:
        stage.note_light(name, "its cone is left out, as only spheres have one")
    profile = shaping.GetShapingIesFileAttr()
    if profile and profile.Get() and profile.Get().path:
        stage.note_light(name, f'its IES file is left out; in the job, ies = "{profile.Get().path}" gives it')
    texture = prim.GetAttribute("inputs:texture:file")
    if texture and texture.HasAuthoredValue() and texture.Get() and texture.Get().path:
        stage.note_light(name, "its texture is left out")


# Millimetres, more or less: what counts is their ratio.
LENS = ("focalLength", "horizontalAperture", "verticalAperture", "horizontalApertureOffset", "verticalApertureOffset")


class UsdMotion:
    """Places of cameras and lights of a stage at any time, in seconds from its time code 0."""

    def __init__(self, stage: Any, file: Path) -> None:
        self.stage, self.file = stage, file
        self.prims: list[Any] = []
        self.rate = float(stage.GetTimeCodesPerSecond()) or 24.0

    def add(self, prim: Any) -> int:
        """Number a prim."""
        self.prims.append(prim)
        return len(self.prims) - 1

    def world_from_node(self, node: int, times: Sequence[float]) -> Float64:
        """(n, 4, 4) place of a prim at n times; its axes keep their lengths."""
        with read_later(self.file):
            caches = (usd().UsdGeom.XformCache(usd().Usd.TimeCode(time * self.rate)) for time in times)
            found = [matrix(cache.GetLocalToWorldTransform(self.prims[node])) for cache in caches]
        return np.array(found).reshape(-1, 4, 4)

    def span(self, nodes: Sequence[int]) -> tuple[float, float] | None:
        """First and last time of what moves any of the prims; None if nothing does."""
        with read_later(self.file):
            samples = {time for node in nodes for time in self._samples(self.prims[node])}
        if len(samples) < 2:
            return None
        first, last = min(samples), max(samples)
        if self.stage.HasAuthoredTimeCodeRange() and self.stage.GetEndTimeCode() > self.stage.GetStartTimeCode():
            first, last = self.stage.GetStartTimeCode(), self.stage.GetEndTimeCode()
        return first / self.rate, last / self.rate

    def _samples(self, prim: Any) -> set[float]:
        found: set[float] = set()
        while prim and not prim.IsPseudoRoot():
            if xformable := usd().UsdGeom.Xformable(prim):
                found |= set(xformable.GetTimeSamples())
            prim = prim.GetParent()
        return found


APERTURE_UNIT = 0.1  # scene units per unit of an aperture, which an orthographic camera sees


def read_camera(prim: Any, node: int, time: Any) -> StageCamera:
    """Read a camera; `node`: its number in the motion of the stage."""
    wide, tall = (_value(prim, key, time) for key in LENS[1:3])
    aspect = wide / tall if wide > 0 and tall > 0 else None
    return StageCamera(name=prim.GetName(), node=node, lens=_lens(prim, time), aspect=aspect)


def _lens(prim: Any, time: Any) -> StageLens:
    """The lens at a time; both field of view and height are 0 where there is none."""
    focal, _, tall, right, above = (_value(prim, key, time) for key in LENS)
    if not tall > 0:
        return StageLens()
    shift = (right / tall, above / tall)
    if usd().UsdGeom.Camera(prim).GetProjectionAttr().Get(time) == "orthographic":
        return StageLens(height=tall * APERTURE_UNIT, shift=shift)
    return StageLens(fov_deg=math.degrees(2 * math.atan2(tall / 2, focal)) if focal > 0 else 0.0, shift=shift)


def _value(prim: Any, key: str, time: Any) -> float:
    found = prim.GetAttribute(key).Get(time)
    return float(found) if found is not None and math.isfinite(found) else 0.0


def _note_dome(prim: Any, time: Any, stage: StageBuilder) -> None:
    """Note how a job gets the light of a dome light, which is left out."""
    texture = prim.GetAttribute("inputs:texture:file").Get(time)
    file = f'file = "{texture.path}"' if texture and texture.path else "an image of its colour"
    remedy = f'a source of type "environment" in the job gives it, with {file}'
    stage.note_light(prim.GetName(), f"light from all around is left out; {remedy}")


def read_usd_stage(file: Path, assets: Assets) -> Stage:
    """Find the cameras and lights of a file.

    Raises:
        SceneError: as `read_usd`.
        ValueError, ...: the file is broken.
    """
    library, found = usd(), StageBuilder()
    with opened(file, assets, Notes()) as stage:
        motion, time = UsdMotion(stage, file), scene_time(stage)
        cache = library.UsdGeom.XformCache(time)
        for prim in visible_prims(stage, ("Camera",), time):
            found.add_camera(read_camera(prim, motion.add(prim), time))
        for prim in visible_prims(stage, LIGHTS, time):
            world = matrix(cache.GetLocalToWorldTransform(prim))
            light = read_light(prim, motion.add(prim), world, time, found)
            found.lights += [light] if light else []
        for prim in visible_prims(stage, DOMES, time):
            _note_dome(prim, time, found)
        up = "z" if library.UsdGeom.GetStageUpAxis(stage) == "Z" else "y"
        metre = None
        if library.UsdGeom.StageHasAuthoredMetersPerUnit(stage):
            metre = float(library.UsdGeom.GetStageMetersPerUnit(stage))
        fps = float(stage.GetFramesPerSecond()) if stage.HasAuthoredMetadata("framesPerSecond") else None
        assets.require_inside()
        fps = fps or (motion.rate if stage.HasAuthoredMetadata("timeCodesPerSecond") else None)
    return found.stage(motion, up=up, metres=metre, fps=fps)
