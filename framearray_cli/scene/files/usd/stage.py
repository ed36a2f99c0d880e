"""Cameras and lights of a USD file, and where they are at any time.

Strengths as the schemas of UsdLux define them: L = intensity x 2^exposure x color is radiance. `normalize` divides it
by the area of the light in the world, or of the sky that a distant light covers, so that its power stays when its size
changes. Dome lights become one panorama: images of longitude and latitude as OpenEXR defines them, or one colour.

Blender's exporter differs from the schemas. Its suns have a quarter of their strength and half of their angle. The
softness of a spot is Blender's `blend`, a share of the cosine. Every light has a temperature, switched on: 6500 K where
none is given, and then it is white. A dome light whose image is not turned in Blender lacks the turn that its exporter
gives all others.
"""

import math
import re
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float32, Float64
from framearray_cli.base.colour import black_body, linear_from_srgb
from framearray_cli.base.errors import OutputError
from framearray_cli.base.openimage import LINEAR_MAPS, read_rgb
from framearray_cli.base.radiance import mend_radiance

from ..assets import AssetError, Assets
from ..model import Notes
from ..staging import Stage, StageBuilder, StageCamera, StageEnvironment, StageLens, StageLight, panorama_bands
from ..textures import decode_image
from .usdcore import matrix, opened, read_asset, read_later, scene_time, usd

SUN_STRENGTH, SUN_ANGLE = 4.0, 2.0
SUN_NOTE = (
    "its strength and angle are 4 and 2 times the values in the file, of which Blender writes a quarter and a half"
)
MADE_BY = re.compile(r"Blender v(\d+)\.")  # documentation of a layer
FIRST = 4  # version that writes lights so
TURN = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])  # about x and then z, by 90 degrees each


def turn_of_dome(prim: Any, time: Any) -> Float64:
    """(3, 3) turn of the image of a dome light before its own: that which Blender left out, or none."""
    local = matrix(usd().UsdGeom.Xformable(prim).GetLocalTransformation(time))
    left_out = is_by_blender(prim, "inputs:texture:file") and bool((local == np.eye(4)).all())
    return TURN if left_out else np.eye(3)


def is_by_blender(prim: Any, key: str = "inputs:intensity") -> bool:
    """True if a value of a light stands in a layer that Blender wrote."""
    attribute = prim.GetAttribute(key)
    specs = attribute.GetPropertyStack(usd().Usd.TimeCode.Default()) if attribute else []
    made = MADE_BY.match(specs[0].layer.documentation) if specs else None
    return made is not None and int(made[1]) >= FIRST


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
    """True if a prim, and all above it, are visible at a time."""
    return bool(usd().UsdGeom.Imageable(prim).ComputeVisibility(time) != "invisible")


def blinks(prim: Any) -> bool:
    """True if the visibility of a prim, or of one above it, changes."""
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
        angle = value("angle", 0.53)
        if is_by_blender(prim):
            shines = SUN_STRENGTH * shines
            angle *= SUN_ANGLE if prim.GetAttribute("inputs:angle").HasAuthoredValue() else 1.0
            stage.note_light(name, SUN_NOTE)
        angle = min(angle, 180.0)
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
    red, green, blue = strength.tolist()
    return StageLight(name=name, node=node, kind=kind, intensity=(red, green, blue), schema="UsdLux", **more)


def _shaped(
    prim: Any, name: str, node: int, strength: Float64, radius: float, time: Any, stage: StageBuilder
) -> StageLight:
    """A sphere, with a cone or an IES profile if it has one."""
    shaping = usd().UsdLux.ShapingAPI(prim)
    profile = shaping.GetShapingIesFileAttr().Get(time)
    if profile is not None and str(profile.resolvedPath or profile.path).endswith("]"):
        stage.note_light(name, "its IES file lies inside the package and is left out; save it next to the scene")
    elif profile is not None and profile.path:
        found = stage.photometry(name, str(profile.resolvedPath or profile.path), "its IES file is left out")
        if found is not None:
            if shaping.GetShapingIesNormalizeAttr().Get(time) or shaping.GetShapingIesAngleScaleAttr().Get(time):
                stage.note_light(name, "normalize and angleScale of its IES file are left out")
            return _light(name, node, "spot", strength * found[1], profile=found[0], radius=radius)
    angle = shaping.GetShapingConeAngleAttr()
    outer = float(angle.Get(time)) if angle and angle.HasAuthoredValue() else 180.0
    if outer > 90:
        if outer < 180:
            stage.note_light(name, f"its cone of {outer:g} degrees is left out, as spots end at 90")
        return _light(name, node, "point", strength, radius=radius)
    soft = float(shaping.GetShapingConeSoftnessAttr().Get(time) or 0.0)
    edge = cone(outer, min(max(soft, 0.0), 1.0), in_cosine=is_by_blender(prim))
    return _light(name, node, "spot", strength, cone_deg=edge, radius=radius)


def cone(outer: float, softness: float, *, in_cosine: bool = False) -> tuple[float, float]:
    """Angles of a spot, degrees.

    Args:
        in_cosine: True if `softness` is a share of the cosine, as in Blender, rather than of the angle.

    The edge of UsdLux is t^2 (3 - 2 t), and here t^2 in the cosine: with the inner cosine at 3/4 of the way from the
    outer one to UsdLux's, both let the same light through, nearly.
    """
    end, start = math.cos(math.radians(outer)), math.cos(math.radians(outer * (1.0 - softness)))
    start = end + softness * (1.0 - end) if in_cosine else start
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
    if prim.GetTypeName() != "SphereLight" and profile and profile.Get() and profile.Get().path:
        stage.note_light(name, "its IES file is left out, as only spheres have one")
    texture = prim.GetAttribute("inputs:texture:file")
    if texture and texture.HasAuthoredValue() and texture.Get() and texture.Get().path:
        stage.note_light(name, "its texture is left out")


# Millimetres, more or less: what counts is their ratio.
LENS = ("focalLength", "horizontalAperture", "verticalAperture", "horizontalApertureOffset", "verticalApertureOffset")
SHAPE = ("inputs:radius", "inputs:width", "inputs:height", "inputs:length", "inputs:angle")
CONE = ("inputs:shaping:cone:angle", "inputs:shaping:cone:softness")
OF_LIGHTS = STRENGTH + SHAPE + CONE


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
            caches = (usd().UsdGeom.XformCache(code) for code in self.codes(times))
            found = [matrix(cache.GetLocalToWorldTransform(self.prims[node])) for cache in caches]
        return np.array(found).reshape(-1, 4, 4)

    def codes(self, times: Sequence[float]) -> list[Any]:
        """The time codes of n times."""
        return [usd().Usd.TimeCode(time * self.rate) for time in times]

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
        for name in (*LENS, *OF_LIGHTS):
            if attribute := prim.GetAttribute(name):
                found |= set(attribute.GetTimeSamples())
        while prim and not prim.IsPseudoRoot():
            if xformable := usd().UsdGeom.Xformable(prim):
                found |= set(xformable.GetTimeSamples())
                found |= set(xformable.GetVisibilityAttr().GetTimeSamples())
            prim = prim.GetParent()
        return found


APERTURE_UNIT = 0.1  # scene units per unit of an aperture, which an orthographic camera sees


def read_camera(prim: Any, motion: UsdMotion, time: Any) -> StageCamera:
    """Read a camera, with its lens at any time where the lens changes."""
    lens = _lens(prim, time)
    wide, tall = (_value(prim, key, time) for key in LENS[1:3])

    def lenses(times: Sequence[float]) -> list[StageLens]:
        with read_later(motion.file):
            found = [_lens(prim, code) for code in motion.codes(times)]
        return [each if each.problem() is None and (each.height > 0) == (lens.height > 0) else lens for each in found]

    changes = any(prim.GetAttribute(key).ValueMightBeTimeVarying() for key in LENS)
    aspect = wide / tall if wide > 0 and tall > 0 else None
    own = {"lenses": lenses} if changes else {}
    return StageCamera(name=prim.GetName(), node=motion.add(prim), lens=lens, aspect=aspect, **own)


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


def changing_light(prim: Any, motion: UsdMotion, time: Any, stage: StageBuilder) -> StageLight | None:
    """Read a light at its first time and, where it changes, at any other, or note why it cannot be used."""
    library, blinking, node = usd(), blinks(prim), motion.add(prim)

    def read(code: Any, stage: StageBuilder) -> StageLight | None:
        world = matrix(library.UsdGeom.XformCache(code).GetLocalToWorldTransform(prim))
        return read_light(prim, node, world, code, stage)

    light = read(time, stage)
    if light is None or not (blinking or any(_changes(prim, key) for key in OF_LIGHTS)):
        return light
    first = light  # of its kind, with its profile

    def at(times: Sequence[float]) -> list[StageLight]:
        found = []
        with read_later(motion.file):
            unheard = StageBuilder(stage.assets)
            looks = [(read(code, unheard), not blinking or is_visible(prim, code)) for code in motion.codes(times)]
        for now, visible in looks:
            same = now if now is not None and now.kind == first.kind else None
            shown = same is not None and visible
            found.append(same if same is not None and shown else replace(same or first, intensity=(0.0, 0.0, 0.0)))
        return found

    return replace(light, at=at)


def _changes(prim: Any, key: str) -> bool:
    attribute = prim.GetAttribute(key)
    return bool(attribute) and bool(attribute.ValueMightBeTimeVarying())


PLAIN_ROWS, MOST_ROWS = 16, 2048  # of the panorama of a colour, and of an image
CODES = 255.0
Z_FROM_Y = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])  # turns y into z
LATLONG = ("automatic", "latlong", "")


def read_domes(domes: list[tuple[Any, Float64]], up: str, time: Any, stage: StageBuilder) -> StageEnvironment | None:
    """Add up all dome lights; None if there are none, or they are black.

    Args:
        domes: prims and their (4, 4) places in the world.
        up: axis of the scene that points up, "y" or "z".
    """
    found: list[tuple[Float32, Float64]] = []  # radiance, and (3, 3) from directions of the panorama
    for prim, world in domes:
        pixels = _pixels(prim, time, stage)
        if pixels is None or not pixels.any():
            continue
        turn = world[:3, :3] / np.maximum(np.linalg.norm(world[:3, :3], axis=0), 1e-30) @ turn_of_dome(prim, time)
        if str(prim.GetTypeName()) == "DomeLight_1":
            axis = str(prim.GetAttribute("poleAxis").Get() or "scene")
            if axis == "Z" or (axis == "scene" and up == "z"):
                turn = turn @ Z_FROM_Y
        found.append((pixels, np.linalg.pinv(turn) @ (Z_FROM_Y if up == "z" else np.eye(3))))
    if not found:
        return None
    rows = min(max(len(pixels) for pixels, _ in found), MOST_ROWS)
    stage.assets.limit.take("a panorama", 2 * rows * rows * 12)
    panorama = sum(_turned(pixels, turn, rows) for pixels, turn in found)
    return StageEnvironment(name=domes[0][0].GetName(), pixels=np.asarray(panorama, np.float32), intensity=1.0)


def _pixels(prim: Any, time: Any, stage: StageBuilder) -> Float32 | None:
    """(h, w, 3) radiance of a dome light; a colour is an image of few pixels."""
    name, colour = prim.GetName(), radiance(prim, time).astype(np.float32)
    if any(prim.GetAttribute(key).ValueMightBeTimeVarying() for key in STRENGTH):
        stage.note_light(name, "its strength changes; its value at the first frame is used")
    asset = prim.GetAttribute("inputs:texture:file").Get(time)
    if asset is None or not asset.path:
        return np.broadcast_to(colour, (PLAIN_ROWS, 2 * PLAIN_ROWS, 3))
    layout = str(prim.GetAttribute("inputs:texture:format").Get(time) or "")
    if layout not in LATLONG:
        stage.note_light(name, f"expected a texture of longitude and latitude, got {layout}; it is left out")
        return None
    try:
        key, read = read_asset(asset, stage.assets)
        pixels, note = mend_radiance(_decode(key, read(), stage.assets), panorama=True)
        if note:
            stage.note_light(name, note)
        return np.asarray(pixels * colour, np.float32)
    except (AssetError, OutputError) as error:
        stage.note_light(name, f"is left out: {error}")
        return None


def _decode(key: str, data: bytes, assets: Assets) -> Float32:
    suffix = Path(key.rstrip("]")).suffix.lower()
    if suffix not in LINEAR_MAPS:
        codes = decode_image(data, Path(key).name, assets.limit)
        return linear_from_srgb((codes[..., :3] / CODES).astype(np.float32))
    with tempfile.TemporaryDirectory(prefix="framearray-") as folder:
        file = Path(folder) / f"dome{suffix}"  # it may lie in a package
        file.write_bytes(data)
        return read_rgb(file)


def _turned(pixels: Float32, local_from_panorama: Float64, rows: int) -> Float32:
    """(rows, 2 rows, 3): north, -z, in the middle, of an image with z in its middle and x to the left of it."""
    height, width, _ = pixels.shape
    bands = []
    for directions in panorama_bands(rows):
        x, y, z = np.moveaxis(directions @ local_from_panorama.T, -1, 0)
        column = (np.pi - np.arctan2(x, z)) / (2 * np.pi) * width - 0.5
        row = np.clip((0.5 - np.arcsin(np.clip(y, -1.0, 1.0)) / np.pi) * height - 0.5, 0, height - 1)
        left, top = np.floor(column + 1e-6).astype(int), np.floor(row + 1e-6).astype(int)  # rounding is no step
        right, below = (left + 1) % width, np.minimum(top + 1, height - 1)
        a, b = np.clip(column - left, 0, 1)[..., None], np.clip(row - top, 0, 1)[..., None]
        upper = pixels[top, left % width] * (1 - a) + pixels[top, right] * a
        lower = pixels[below, left % width] * (1 - a) + pixels[below, right] * a
        bands.append(np.asarray(upper * (1 - b) + lower * b, np.float32))
    return np.concatenate(bands)


def read_usd_stage(file: Path, assets: Assets) -> Stage:
    """Find the cameras and lights of a file.

    Raises:
        SceneError: as `read_usd`.
        ValueError, ...: the file is broken.
    """
    library, found = usd(), StageBuilder(assets)
    with opened(file, assets, Notes()) as stage:
        motion, time = UsdMotion(stage, file), scene_time(stage)
        cache = library.UsdGeom.XformCache(time)
        for prim in visible_prims(stage, ("Camera",)):
            found.add_camera(read_camera(prim, motion, time))
        for prim in visible_prims(stage, LIGHTS):
            found.add_light(changing_light(prim, motion, time, found))
        up = "z" if library.UsdGeom.GetStageUpAxis(stage) == "Z" else "y"
        shown = [prim for prim in visible_prims(stage, DOMES) if is_visible(prim, time)]
        domes = [(prim, matrix(cache.GetLocalToWorldTransform(prim))) for prim in shown]
        environment = read_domes(domes, up, time, found)
        metre = None
        if library.UsdGeom.StageHasAuthoredMetersPerUnit(stage):
            metre = float(library.UsdGeom.GetStageMetersPerUnit(stage))
        fps = float(stage.GetFramesPerSecond()) if stage.HasAuthoredMetadata("framesPerSecond") else None
        assets.require_inside()
        fps = fps or (motion.rate if stage.HasAuthoredMetadata("timeCodesPerSecond") else None)
    return found.stage(motion, environment=environment, up=up, metres=metre, fps=fps)
