"""Lights whose strength, size or visibility changes: what they are at any time."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from ..assets import Assets
from ..staging import StageLight
from .lights import blinks, is_visible, read_light
from .motion import OF_LIGHTS, UsdMotion
from .nodes import matrix
from .usdcore import read_later, usd


def changing_light(prim: Any, motion: UsdMotion, time: Any, assets: Assets, notes: list[str]) -> StageLight | None:
    """Read a light at its first time and, where it changes, at any other, or note why it cannot be used."""
    library, blinking, node = usd(), blinks(prim), motion.add(prim)

    def read(code: Any, notes: list[str]) -> StageLight | None:
        world = matrix(library.UsdGeom.XformCache(code).GetLocalToWorldTransform(prim))
        return read_light(prim, node, world, code, assets, notes)

    light = read(time, notes)
    if light is None or not (blinking or any(_changes(prim, key) for key in OF_LIGHTS)):
        return light
    first = light  # of its kind, with its profile

    def at(times: Sequence[float]) -> list[StageLight]:
        found = []
        with read_later(motion.file):
            looks = [(read(code, []), not blinking or is_visible(prim, code)) for code in motion.codes(times)]
        for now, visible in looks:
            same = now if now is not None and now.kind == first.kind else None
            shown = same is not None and visible
            found.append(same if same is not None and shown else replace(same or first, intensity=(0.0, 0.0, 0.0)))
        return found

    return replace(light, at=at)


def _changes(prim: Any, key: str) -> bool:
    attribute = prim.GetAttribute(key)
    return bool(attribute) and bool(attribute.ValueMightBeTimeVarying())
