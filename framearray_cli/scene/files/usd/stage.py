"""Cameras and lights of a USD file, and where they are at any time."""

from pathlib import Path

from ..assets import Assets
from ..model import Notes
from ..staging import Stage, StageCamera
from .cameras import read_camera
from .changing import changing_light
from .dome import read_domes
from .lights import DOMES, LIGHTS, is_visible, visible_prims
from .motion import UsdMotion
from .nodes import matrix, scene_time
from .usdcore import opened, usd


def read_usd_stage(file: Path, assets: Assets) -> Stage:
    """Find the cameras and lights of a file.

    Raises:
        SceneError: as `read_usd`.
        ValueError, ...: the file is broken.
    """
    library, left = usd(), Notes()
    notes: list[str] = []
    with opened(file, assets, left) as stage:
        motion, time = UsdMotion(stage, file), scene_time(stage)
        cache = library.UsdGeom.XformCache(time)
        cameras: list[StageCamera] = []
        for prim in visible_prims(stage, ("Camera",)):
            if (camera := read_camera(prim, motion, time, notes)) is not None:
                cameras.append(camera)
        lights = []
        for prim in visible_prims(stage, LIGHTS):
            light = changing_light(prim, motion, time, assets, notes)
            lights += [light] if light else []
        up = "z" if library.UsdGeom.GetStageUpAxis(stage) == "Z" else "y"
        shown = [prim for prim in visible_prims(stage, DOMES) if is_visible(prim, time)]
        domes = [(prim, matrix(cache.GetLocalToWorldTransform(prim))) for prim in shown]
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
