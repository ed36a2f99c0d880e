"""Cameras and lights of a USD file, and where they are at any time."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float64

from ..assets import Assets
from ..model import Notes
from ..staging import Stage, StageCamera
from .dome import read_domes
from .library import opened, usd
from .lights import DOMES, LIGHTS, light_prims, read_light
from .nodes import matrix, scene_time

LENS = ("focalLength", "horizontalAperture", "verticalAperture", "horizontalApertureOffset", "verticalApertureOffset")


class UsdMotion:
    """Where cameras and lights of a stage are at any time, in seconds from its time code 0."""

    def __init__(self, stage: Any) -> None:
        self.stage, self.prims = stage, []  # type: Any, list[Any]
        self.rate = float(stage.GetTimeCodesPerSecond()) or 24.0

    def add(self, prim: Any) -> int:
        """Number a prim."""
        self.prims.append(prim)
        return len(self.prims) - 1

    def world_from_node(self, node: int, times: Sequence[float]) -> Float64:
        """(n, 4, 4) place of a prim at n times; its axes keep their lengths."""
        library = usd()
        codes = [library.Usd.TimeCode(time * self.rate) for time in times]
        caches = (library.UsdGeom.XformCache(code) for code in codes)
        return np.array([matrix(cache.GetLocalToWorldTransform(self.prims[node])) for cache in caches]).reshape(
            -1, 4, 4
        )

    def span(self, nodes: Sequence[int]) -> tuple[float, float] | None:
        """First and last time of what moves any of the prims; None if nothing does."""
        samples = {time for node in nodes for time in self._samples(self.prims[node])}
        if len(samples) < 2:
            return None
        first, last = min(samples), max(samples)
        if self.stage.HasAuthoredTimeCodeRange() and self.stage.GetEndTimeCode() > self.stage.GetStartTimeCode():
            first, last = self.stage.GetStartTimeCode(), self.stage.GetEndTimeCode()
        return first / self.rate, last / self.rate

    def _samples(self, prim: Any) -> set[float]:
        found: set[float] = set()
        for name in LENS:
            if attribute := prim.GetAttribute(name):
                found |= set(attribute.GetTimeSamples())
        while prim and not prim.IsPseudoRoot():
            if xformable := usd().UsdGeom.Xformable(prim):
                found |= set(xformable.GetTimeSamples())
            prim = prim.GetParent()
        return found


def read_usd_stage(file: Path, assets: Assets) -> Stage:
    """Find the cameras and lights of a file.

    Raises:
        SceneError: as `read_usd`.
        ValueError, ...: the file is broken.
    """
    library, left = usd(), Notes()
    notes: list[str] = []
    with opened(file, assets, left) as stage:
        motion, time = UsdMotion(stage), scene_time(stage)
        cache = library.UsdGeom.XformCache(time)
        cameras: list[StageCamera] = []
        for prim in light_prims(stage, ("Camera",)):
            if (camera := _camera(prim, motion, time, notes)) is not None:
                cameras.append(camera)
        lights = []
        for prim in light_prims(stage, LIGHTS):
            world = matrix(cache.GetLocalToWorldTransform(prim))
            light = read_light(prim, motion.add(prim), world, time, assets, notes)
            lights += [light] if light else []
        up = "z" if library.UsdGeom.GetStageUpAxis(stage) == "Z" else "y"
        domes = [(prim, matrix(cache.GetLocalToWorldTransform(prim))) for prim in light_prims(stage, DOMES)]
        environment = read_domes(domes, up, time, assets, notes)
        metre = None
        if library.UsdGeom.StageHasAuthoredMetersPerUnit(stage):
            metre = float(library.UsdGeom.GetStageMetersPerUnit(stage))
        fps = float(stage.GetFramesPerSecond()) if stage.HasAuthoredMetadata("framesPerSecond") else None
        assets.require_inside()
    return Stage(
        cameras=tuple(cameras),
        lights=tuple(lights),
        environment=environment,
        motion=motion,
        notes=tuple(notes),
        up=up,
        metres=metre,
        fps=fps or (motion.rate if stage.HasAuthoredMetadata("timeCodesPerSecond") else None),
    )


def _camera(prim: Any, motion: UsdMotion, time: Any, notes: list[str]) -> StageCamera | None:
    """Read a camera, or note why it cannot be used."""
    name, camera = prim.GetName(), usd().UsdGeom.Camera(prim)
    if camera.GetProjectionAttr().Get(time) == "orthographic":
        notes.append(f"camera {name}: is not a perspective camera and is left out")
        return None
    focal, wide, tall = (float(prim.GetAttribute(key).Get(time) or 0.0) for key in LENS[:3])
    fov = math.degrees(2 * math.atan2(tall / 2, focal)) if focal > 0 and tall > 0 else 0.0
    if not 0.001 <= fov <= 179.9:  # the range that a job accepts
        notes.append(f"camera {name}: has a field of view of {fov:g} degrees and is left out")
        return None
    if prim.GetAttribute("focalLength").ValueMightBeTimeVarying():
        notes.append(f"camera {name}: its focal length changes; that of the first frame is taken")
    if any(prim.GetAttribute(key).Get(time) for key in LENS[3:]):
        notes.append(f"camera {name}: its lens shift is left out")
    return StageCamera(name=name, node=motion.add(prim), fov_deg=fov, aspect=wide / tall if wide > 0 else None)
