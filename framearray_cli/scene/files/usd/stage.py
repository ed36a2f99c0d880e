"""Cameras and lights of a USD file, and where they are at any time.

Strengths as the schemas of UsdLux define them: L = intensity x 2^exposure x color is radiance. `normalize` divides it
by the area of the light in the world, or of the sky that a distant light covers, so that its power stays when its size
changes. Only places change over time; the first frame gives lenses, strengths and sizes.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.base.colour import black_body
from framearray_cli.base.units import LEAST_FPS, MOST_FPS

from ..assets import Assets
from ..model import Notes, rgb3
from ..staging import Stage, StageBuilder, StageCamera, StageLens, StageLight
from .usdcore import matrix, opened, read_later, scene_time, time_rate, usd

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


def authored(attribute: Any, time: Any, default: Any = None) -> Any:
    """The value of an attribute; the default without one of the file."""
    return attribute.Get(time) if attribute and attribute.HasAuthoredValue() else default


def file_of(attribute: Any, time: Any) -> str:
    """The path that an attribute names, or ""."""
    return str(getattr(authored(attribute, time), "path", ""))


@dataclass(frozen=True, slots=True, kw_only=True)
class UsdLight:
    """A light of a stage.

    Attributes:
        node: its number in the motion of the stage.
        stage: gets notes on what is left out of it.
    """

    prim: Any
    node: int
    time: Any
    stage: StageBuilder

    def read(self, world: Float64) -> StageLight | None:
        """Read the light, or note why it cannot be used.

        Args:
            world: (4, 4) its place in the world.
        """
        kind, shines, value = str(self.prim.GetTypeName()), self._radiance(), self._value
        normal = bool(usd().UsdLux.LightAPI(self.prim).GetNormalizeAttr().Get(self.time))
        x, y, z = (float(np.linalg.norm(world[:3, k])) for k in range(3))
        self._note_left_out()
        if kind == "DistantLight":
            angle = min(value("angle", 0.53), 180.0)
            sky = math.pi * math.sin(math.radians(angle) / 2) ** 2
            irradiance = shines if normal or sky == 0 else shines * sky
            return self._light("directional", irradiance, angle_deg=min(angle, 90.0))
        if kind == "CylinderLight":
            radius, length = value("radius", 0.5) * (y + z) / 2, value("length", 1.0) * x
            self._note("the cylinder is taken as a sphere of its power")
            side = math.pi / 2 * radius * length  # radiance -> mean radiant intensity of its side
            return self._light("point", shines * (0.25 if normal else side), radius=radius)
        if kind == "SphereLight":
            radius = value("radius", 0.5) * (x + y + z) / 3
            return self._shaped(shines * (0.25 if normal else math.pi * radius**2), radius)
        width, height = value("width", 1.0) * x, value("height", 1.0) * y
        radius = value("radius", 0.5) * (x + y) / 2
        area = width * height if kind == "RectLight" else math.pi * radius**2
        if not area > 0:
            self._note("has no area and is left out")
            return None
        if kind == "RectLight":
            return self._light("rect", shines / (area if normal else 1.0), size=(width, height))
        return self._light("disc", shines / (area if normal else 1.0), radius=radius)

    def note_dome(self) -> None:
        """Note how a job gets the light of a dome light, which is left out."""
        texture = self.prim.GetAttribute("inputs:texture:file").Get(self.time)
        file = f'file = "{texture.path}"' if texture and texture.path else "an image of its colour"
        remedy = f'a source of type "environment" in the job gives it, with {file}'
        self._note(f"light from all around is left out; {remedy}")

    def _note(self, text: str) -> None:
        self.stage.notes.append(f"light {self.prim.GetName()}: {text}")

    def _value(self, key: str, default: float) -> float:
        found = self.prim.GetAttribute(f"inputs:{key}").Get(self.time)
        return default if found is None or not math.isfinite(found) else abs(float(found))

    def _radiance(self) -> Float64:
        """(3,) intensity, exposure, colour and temperature together."""
        api, time = usd().UsdLux.LightAPI(self.prim), self.time
        exposure = float(api.GetExposureAttr().Get(time) or 0.0)
        found = np.array(api.GetColorAttr().Get(time) or (1.0, 1.0, 1.0), np.float64)
        found = found * float(api.GetIntensityAttr().Get(time) or 0.0) * 2.0 ** min(max(exposure, -99.0), 99.0)
        if api.GetEnableColorTemperatureAttr().Get(time):
            kelvin = float(api.GetColorTemperatureAttr().Get(time) or WHITE)
            found = found * np.array(black_body(min(max(kelvin, COLDEST), HOTTEST)))
        return np.where(np.isfinite(found), np.maximum(found, 0.0), 0.0)

    def _light(self, kind: Any, strength: Float64, **more: Any) -> StageLight:
        name = self.prim.GetName()
        return StageLight(name=name, node=self.node, kind=kind, intensity=rgb3(strength), schema="UsdLux", **more)

    def _shaped(self, strength: Float64, radius: float) -> StageLight:
        """A sphere, with a cone if it has one."""
        shaping = usd().UsdLux.ShapingAPI(self.prim)
        outer = float(authored(shaping.GetShapingConeAngleAttr(), self.time, 180.0))
        if outer > 90:
            if outer < 180:
                self._note(f"its cone of {outer:g} degrees is left out, as spots end at 90")
            return self._light("point", strength, radius=radius)
        soft = float(shaping.GetShapingConeSoftnessAttr().Get(self.time) or 0.0)
        return self._light("spot", strength, cone_deg=cone(outer, min(max(soft, 0.0), 1.0)), radius=radius)

    def _note_left_out(self) -> None:
        prim, shaping, time = self.prim, usd().UsdLux.ShapingAPI(self.prim), self.time
        if authored(shaping.GetShapingFocusAttr(), time):
            self._note("its focus is left out")
        if prim.GetTypeName() != "SphereLight" and authored(shaping.GetShapingConeAngleAttr(), time, 90.0) < 90:
            self._note("its cone is left out, as only spheres have one")
        if profile := file_of(shaping.GetShapingIesFileAttr(), time):
            self._note(f'its IES file is left out; in the job, ies = "{profile}" gives it')
        if file_of(prim.GetAttribute("inputs:texture:file"), time):
            self._note("its texture is left out")


def cone(outer: float, softness: float) -> tuple[float, float]:
    """Angles of a spot, degrees.

    The edge of UsdLux is t^2 (3 - 2 t), and here t^2 in the cosine: with the inner cosine at 3/4 of the way from the
    outer one to UsdLux's, both let the same light through, nearly.
    """
    end, start = math.cos(math.radians(outer)), math.cos(math.radians(outer * (1.0 - softness)))
    return math.degrees(math.acos(min(0.75 * start + 0.25 * end, 1.0))), outer


# Millimetres, more or less: what counts is their ratio.
LENS = ("focalLength", "horizontalAperture", "verticalAperture", "horizontalApertureOffset", "verticalApertureOffset")


class UsdMotion:
    """Places of cameras and lights of a stage at any time, in seconds from its time code 0."""

    def __init__(self, stage: Any, file: Path) -> None:
        self.stage, self.file = stage, file
        self.prims: list[Any] = []
        self.rate = time_rate(stage)

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
    """Read a camera; its lens sees nothing if the aperture has no height.

    Args:
        node: its number in the motion of the stage.
    """
    found = (prim.GetAttribute(key).Get(time) for key in LENS)
    focal, wide, tall, right, above = (
        float(value) if value is not None and math.isfinite(value) else 0.0 for value in found
    )
    lens = StageLens()
    if tall > 0:
        perspective = usd().UsdGeom.Camera(prim).GetProjectionAttr().Get(time) != "orthographic"
        fov_deg = math.degrees(2 * math.atan2(tall / 2, focal)) if perspective and focal > 0 else 0.0
        height = 0.0 if perspective else tall * APERTURE_UNIT
        lens = StageLens(fov_deg=fov_deg, height=height, shift=(right / tall, above / tall))
    return StageCamera(name=prim.GetName(), node=node, lens=lens, aspect=wide / tall if wide > 0 and tall > 0 else None)


def _mistyped(prim: Any, time: Any) -> str:
    """Return the place of a value with another type than its attribute, which the library accepts; "" without one."""
    for attribute in prim.GetAuthoredAttributes():
        kind, value = attribute.GetTypeName(), attribute.Get(time)
        if value is None or kind.isArray:
            continue
        (shape, is_number), wanted = (
            (found.shape, found.dtype.kind in "biuf") for found in (np.asarray(value), np.asarray(kind.defaultValue))
        )
        if (shape, is_number) != wanted:
            return f"{attribute.GetPath()}: expected a value of type {kind}"
    return ""


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
        for prim in visible_prims(stage, ("Camera", *LIGHTS), time):
            if problem := _mistyped(prim, time):
                found.notes.append(f"{problem}; {prim.GetName()} is left out")
            elif prim.GetTypeName() == "Camera":
                found.add_camera(read_camera(prim, motion.add(prim), time))
            else:
                source = UsdLight(prim=prim, node=motion.add(prim), time=time, stage=found)
                light = source.read(matrix(cache.GetLocalToWorldTransform(prim)))
                found.lights += [light] if light else []
        for prim in visible_prims(stage, DOMES, time):
            UsdLight(prim=prim, node=-1, time=time, stage=found).note_dome()
        up = "z" if library.UsdGeom.GetStageUpAxis(stage) == "Z" else "y"
        metre = None
        if library.UsdGeom.StageHasAuthoredMetersPerUnit(stage):
            metre = float(library.UsdGeom.GetStageMetersPerUnit(stage))
        fps = float(stage.GetFramesPerSecond()) if stage.HasAuthoredMetadata("framesPerSecond") else None
        assets.require_inside()
        fps = fps or (motion.rate if stage.HasAuthoredMetadata("timeCodesPerSecond") else None)
        fps = fps if fps is None or LEAST_FPS <= fps <= MOST_FPS else None
    return found.stage(motion, up=up, metres=metre, fps=fps)
