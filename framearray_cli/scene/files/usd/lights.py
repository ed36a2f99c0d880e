"""UsdLux lights -> lights of a first job.

Strengths as the schemas define them: L = intensity x 2^exposure x color is radiance. `normalize` divides it by the area
of the light in the world, or of the sky that a distant light covers, so that its power stays when its size changes.
"""

import math
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.base.blackbody import black_body
from framearray_cli.job.ies import read_photometry
from framearray_cli.job.rowfile import RowFileError

from ..assets import AssetError, Assets
from ..staging import StageLight
from .blender import SUN_ANGLE, SUN_NOTE, SUN_STRENGTH, is_by_blender
from .usdcore import usd

LIGHTS = ("SphereLight", "DiskLight", "RectLight", "CylinderLight", "DistantLight")
DOMES = ("DomeLight", "DomeLight_1")
COLDEST, HOTTEST = 1000.0, 10000.0  # kelvin, the range of the schema
STRENGTH = ("inputs:intensity", "inputs:exposure", "inputs:color", "inputs:colorTemperature")
WHITE = 6500.0  # kelvin, its default


def visible_prims(stage: Any, kinds: tuple[str, ...]) -> list[Any]:
    """The prims of some types that are visible at some time, in the order of the stage."""
    library, found = usd(), []
    for prim in library.Usd.PrimRange.Stage(stage, library.Usd.TraverseInstanceProxies()):
        if prim.GetTypeName() in kinds and (blinks(prim) or is_visible(prim, library.Usd.TimeCode.Default())):
            found.append(prim)
    return found


def is_visible(prim: Any, time: Any) -> bool:
    """Whether a prim, and all above it, are visible at a time."""
    return bool(usd().UsdGeom.Imageable(prim).ComputeVisibility(time) != "invisible")


def blinks(prim: Any) -> bool:
    """Whether the visibility of a prim, or of one above it, changes."""
    while prim and not prim.IsPseudoRoot():
        imageable = usd().UsdGeom.Imageable(prim)
        if imageable and imageable.GetVisibilityAttr().ValueMightBeTimeVarying():
            return True
        prim = prim.GetParent()
    return False


def count_lights(stage: Any) -> int:
    """The number of lights."""
    return len(visible_prims(stage, LIGHTS + DOMES))


def radiance(prim: Any, time: Any) -> Float64:
    """(3,) intensity, exposure, colour and temperature together."""
    api = usd().UsdLux.LightAPI(prim)
    exposure = float(api.GetExposureAttr().Get(time) or 0.0)
    found = np.array(api.GetColorAttr().Get(time) or (1.0, 1.0, 1.0), np.float64)
    found = found * float(api.GetIntensityAttr().Get(time) or 0.0) * 2.0 ** min(max(exposure, -99.0), 99.0)
    kelvin = float(api.GetColorTemperatureAttr().Get(time) or WHITE) if _has_temperature(api, time) else None
    if kelvin is not None and not (kelvin == WHITE and is_by_blender(prim)):
        found = found * np.array(black_body(min(max(kelvin, COLDEST), HOTTEST)))
    return np.where(np.isfinite(found), np.maximum(found, 0.0), 0.0)


def _has_temperature(api: Any, time: Any) -> bool:
    return bool(api.GetEnableColorTemperatureAttr().Get(time))


def read_light(prim: Any, node: int, world: Float64, time: Any, assets: Assets, notes: list[str]) -> StageLight | None:
    """Read a light, or note why it cannot be used.

    Args:
        node: its number in the motion of the stage.
        world: (4, 4) its place in the world.
    """
    name, kind = prim.GetName(), str(prim.GetTypeName())
    shines = radiance(prim, time)
    normal = bool(usd().UsdLux.LightAPI(prim).GetNormalizeAttr().Get(time))
    x, y, z = (float(np.linalg.norm(world[:3, k])) for k in range(3))
    _note(prim, name, notes)

    def value(key: str, default: float) -> float:
        found = prim.GetAttribute(f"inputs:{key}").Get(time)
        return default if found is None or not math.isfinite(found) else abs(float(found))

    if kind == "DistantLight":
        angle = value("angle", 0.53)
        if is_by_blender(prim):
            shines = SUN_STRENGTH * shines
            angle *= SUN_ANGLE if prim.GetAttribute("inputs:angle").HasAuthoredValue() else 1.0
            notes.append(f"light {name}: {SUN_NOTE}")
        angle = min(angle, 180.0)
        sky = math.pi * math.sin(math.radians(angle) / 2) ** 2
        irradiance = shines if normal or sky == 0 else shines * sky
        return _light(name, node, "directional", irradiance, angle_deg=angle if angle <= 90 else 90.0)
    if kind == "RectLight":
        width, height = value("width", 1.0) * x, value("height", 1.0) * y
        if not width * height > 0:
            notes.append(f"light {name}: has no area and is left out")
            return None
        return _light(name, node, "rect", shines / (width * height if normal else 1.0), size=(width, height))
    radius = value("radius", 0.5) * (x + y) / 2
    if kind == "DiskLight":
        if not radius > 0:
            notes.append(f"light {name}: has no area and is left out")
            return None
        return _light(name, node, "disc", shines / (math.pi * radius**2 if normal else 1.0), radius=radius)
    if kind == "CylinderLight":
        radius, length = value("radius", 0.5) * (y + z) / 2, value("length", 1.0) * x
        notes.append(f"light {name}: the cylinder is taken as a sphere of its power")
        side = math.pi / 2 * radius * length  # radiance -> mean radiant intensity of its side
        return _light(name, node, "point", shines * (0.25 if normal else side), radius=radius)
    radius = value("radius", 0.5) * (x + y + z) / 3
    strength = shines * (0.25 if normal else math.pi * radius**2)
    return _shaped(prim, name, node, strength, radius, time, assets, notes)


def _light(name: str, node: int, kind: Any, strength: Float64, **more: Any) -> StageLight:
    red, green, blue = strength.tolist()
    return StageLight(name=name, node=node, kind=kind, intensity=(red, green, blue), schema="UsdLux", **more)


def _shaped(
    prim: Any, name: str, node: int, strength: Float64, radius: float, time: Any, assets: Assets, notes: list[str]
) -> StageLight | None:
    """A sphere, with a cone or an IES profile if it has one."""
    shaping = usd().UsdLux.ShapingAPI(prim)
    profile = shaping.GetShapingIesFileAttr().Get(time)
    if profile is not None and str(profile.resolvedPath or profile.path).endswith("]"):
        notes.append(f"light {name}: its IES file lies inside the package and is left out; save it beside the scene")
    elif profile is not None and profile.path:
        try:
            file = assets.locate(str(profile.resolvedPath or profile.path))
            web = read_photometry(file)
            peak = web.factor * max(map(max, web.candela))
            if shaping.GetShapingIesNormalizeAttr().Get(time) or shaping.GetShapingIesAngleScaleAttr().Get(time):
                notes.append(f"light {name}: normalize and angleScale of its IES file are left out")
            return _light(name, node, "spot", strength * peak, profile=file, radius=radius)
        except AssetError as error:
            notes.append(f"light {name}: its IES file is left out: {error}")
        except RowFileError as error:
            notes.append(f"light {name}: its IES file is left out: {error.args[0]}")
    angle = shaping.GetShapingConeAngleAttr()
    outer = float(angle.Get(time)) if angle and angle.HasAuthoredValue() else 180.0
    if outer > 90:
        if outer < 180:
            notes.append(f"light {name}: its cone of {outer:g} degrees is left out, as spots end at 90")
        return _light(name, node, "point", strength, radius=radius)
    soft = float(shaping.GetShapingConeSoftnessAttr().Get(time) or 0.0)
    edge = cone(outer, min(max(soft, 0.0), 1.0), in_cosine=is_by_blender(prim))
    return _light(name, node, "spot", strength, cone_deg=edge, radius=radius)


def cone(outer: float, softness: float, *, in_cosine: bool = False) -> tuple[float, float]:
    """Angles of a spot, degrees.

    Args:
        in_cosine: whether `softness` is a share of the cosine, as in Blender, rather than of the angle.

    The edge of UsdLux is t^2 (3 - 2 t), and here t^2 in the cosine: with the inner cosine at 3/4 of the way from the
    outer one to that of UsdLux both let the same light through, nearly.
    """
    end, start = math.cos(math.radians(outer)), math.cos(math.radians(outer * (1.0 - softness)))
    start = end + softness * (1.0 - end) if in_cosine else start
    return math.degrees(math.acos(min(0.75 * start + 0.25 * end, 1.0))), outer


def _note(prim: Any, name: str, notes: list[str]) -> None:
    """Note what of a light is left out."""
    shaping = usd().UsdLux.ShapingAPI(prim)
    focus = shaping.GetShapingFocusAttr()
    if focus and focus.HasAuthoredValue() and focus.Get():
        notes.append(f"light {name}: its focus is left out")
    angle = shaping.GetShapingConeAngleAttr()
    if prim.GetTypeName() != "SphereLight" and angle and angle.HasAuthoredValue() and angle.Get() < 90:
        notes.append(f"light {name}: its cone is left out, as only spheres have one")
    profile = shaping.GetShapingIesFileAttr()
    if prim.GetTypeName() != "SphereLight" and profile and profile.Get() and profile.Get().path:
        notes.append(f"light {name}: its IES file is left out, as only spheres have one")
    texture = prim.GetAttribute("inputs:texture:file")
    if texture and texture.HasAuthoredValue() and texture.Get() and texture.Get().path:
        notes.append(f"light {name}: its texture is left out")
