"""Where cameras and lights of a USD stage are at any time, and which of their values change."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float64

from .lights import STRENGTH
from .nodes import matrix
from .usdcore import read_later, usd

# Millimetres, more or less: what counts is their ratio.
LENS = ("focalLength", "horizontalAperture", "verticalAperture", "horizontalApertureOffset", "verticalApertureOffset")
SHAPE = ("inputs:radius", "inputs:width", "inputs:height", "inputs:length", "inputs:angle")
CONE = ("inputs:shaping:cone:angle", "inputs:shaping:cone:softness")
OF_LIGHTS = STRENGTH + SHAPE + CONE


class UsdMotion:
    """Where cameras and lights of a stage are at any time, in seconds from its time code 0."""

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
