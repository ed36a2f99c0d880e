"""UsdGeomCamera -> cameras of a first job, with their lenses at any time."""

import math
from collections.abc import Sequence
from typing import Any

from framearray_cli.job.camera import LEAST_FOV, LEAST_HEIGHT, MOST_FOV, MOST_HEIGHT
from framearray_cli.job.values import MOST_SHIFT

from ..staging import StageCamera, StageLens
from .motion import LENS, UsdMotion
from .usdcore import read_later, usd

APERTURE_UNIT = 0.1  # scene units per unit of an aperture, which an orthographic camera sees


def read_camera(prim: Any, motion: UsdMotion, time: Any, notes: list[str]) -> StageCamera | None:
    """Read a camera, or note why it cannot be used."""
    name = prim.GetName()
    lens = _lens(prim, time)
    if (problem := _problem(lens)) is not None:
        notes.append(f"camera {name}: {problem} and is left out")
        return None
    wide, tall = (_value(prim, key, time) for key in LENS[1:3])

    def lenses(times: Sequence[float]) -> list[StageLens]:
        with read_later(motion.file):
            found = [_lens(prim, code) for code in motion.codes(times)]
        return [each if _problem(each) is None and (each.height > 0) == (lens.height > 0) else lens for each in found]

    changes = any(prim.GetAttribute(key).ValueMightBeTimeVarying() for key in LENS)
    aspect = wide / tall if wide > 0 else None
    own = {"lenses": lenses} if changes else {}
    return StageCamera(name=name, node=motion.add(prim), lens=lens, aspect=aspect, **own)


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


def _problem(lens: StageLens) -> str | None:
    """What makes a lens one that no job accepts."""
    if max(map(abs, lens.shift)) > MOST_SHIFT:
        return f"has a lens shift of {max(lens.shift, key=abs):g} heights of its picture"
    if lens.height > 0:
        return None if LEAST_HEIGHT <= lens.height <= MOST_HEIGHT else f"sees a height of {lens.height:g} scene units"
    return None if LEAST_FOV <= lens.fov_deg <= MOST_FOV else f"has a field of view of {lens.fov_deg:g} degrees"
