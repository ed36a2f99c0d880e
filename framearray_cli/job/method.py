"""Settings of images: `[samples]`, `[reuse]`, and a table for each term of their light."""

import math
from typing import Literal

from pydantic import Field, ValidationInfo, field_validator

from framearray_cli.base.forms.table import Problems, Table, fail, optional
from framearray_cli.base.forms.words import shown

from .values import MOST_HITS, Emission, HalfWindow, HitCount

DEFAULT_N_R, DEFAULT_HITS = 3, 2.0  # of [FA]; settings chosen for "auto" must be as exact


class SamplesTable(Table):
    """Number of samples of a picture.

    Attributes:
        hits: Native hits per pixel and frame. With reuse a pixel averages up to (2 n_r + 1) times as many. 0.5: one in
            every second pixel, and in the others in the next frame; any unit fraction down to 1/8. "auto": chosen from
            the camera path, for the least time at the error of n_r = 3 and hits = 2 on an ordinary walk.
        obscurance: Obscurance rays per hit. With light from cells these are the rays that read cells, and with
            `indirect.exact` the paths.
        error: Instead of `hits`: the target error of every image: the root mean square of the standard errors of its
            pixels, over the mean radiance of the array. A pilot render determines the number of native hits for each
            place of each frame; noisy places that few frames see get most. Reflections in mirrors do not count.
        most_hits: With `error`: maximum number of native hits per pixel and frame.
        halves: Sample every pixel in two independent halves. Their difference gives the standard error of each pixel,
            which EXR images then hold in channels `error` and `difference`.
    """

    hits: HitCount = DEFAULT_HITS
    obscurance: int = Field(default=5, ge=1, le=65535)
    error: float | None = optional("the number of samples is `hits`", gt=0, le=10)
    most_hits: int = Field(default=32, ge=1, le=1024)
    halves: bool = False

    def problems(self) -> Problems:
        """Check that a number or an error determines the hits."""
        if self.error is not None and "hits" in self.model_fields_set:
            yield ("error",), "expected either hits or error: with an error, a pilot settles the hits"
        if self.error is None and "most_hits" in self.model_fields_set:
            yield ("most_hits",), "expected error next to it: it bounds the hits for an error"


class ReuseTable(Table):
    """Reuse of the samples of one camera position by its neighbours.

    Attributes:
        n_r: Number N_r of camera positions before and after each one that share their hits. 0: no reuse. "auto": chosen
            from the camera path, as for `hits`; if `hits` is given, for the error of n_r = 3 with it.
        weights: "average": all hits of a pixel have the same weight, and gloss looks as the eye that found a hit saw
            it, for comparison. "balance": the weight of a hit follows from how densely its eye samples the place, which
            removes the error at silhouettes and texture edges and costs more rays. "area": the weight of a hit is its
            part of the pixel, which removes a third of the noise at edges; where a surface has just come into view, as
            with "balance".
    """

    n_r: HalfWindow = DEFAULT_N_R
    weights: Literal["average", "balance", "area"] = "area"


class ObscuranceTable(Table):
    """Indirect light: distances at which surfaces obscure each other.

    Attributes:
        range: Distance d_max beyond which a surface no longer obscures another, in scene units.
        falloff: Rise of the openness rho from 0 at distance 0 to 1 at `range`. "constant" is 0 below `range`: plain
            ambient occlusion.
        tau: Steepness of "exponential": rho = (1 - exp(-tau d / d_max)) / (1 - exp(-tau)). Other falloffs ignore it.
        outside: Contribution of a ray that meets nothing within `range`. "average": the average reflectivity times the
            ambient light. "background": the ray continues, and contributes the background if it leaves the scene.
    """

    range: float | None = optional("half the free height at the cameras, or a fifth of the scene's size", gt=0, le=1e12)

    @field_validator("range", mode="before")
    @classmethod
    def _compares(cls, value: object) -> object:
        if isinstance(value, int | float) and not isinstance(value, bool) and value == 0:
            fail([((), f"expected a number above 0, got {shown(value)}: nothing is within it")])
        if isinstance(value, float) and not math.isfinite(value):
            fail([((), f"expected a finite number above 0, got {shown(value)}: distances are measured against it")])
        return value

    falloff: Literal["sqrt", "linear", "cbrt", "exponential", "constant"] = "sqrt"
    tau: float = Field(default=3.0, ge=0.001, le=100)
    outside: Literal["average", "background"] = "average"


class IndirectTable(Table):
    """Method for indirect light.

    Attributes:
        method: "obscurance": obscurances times one ambient light per light position. "cells": all bounces of light are
            solved once for small cells of the surfaces under every light position, and obscurance rays read the cells
            that they meet.
        cell: Edge of the smallest cells, in scene units. Cells farther away are up to 16 times as large.
        samples: Number of walks that sample the cells.
        filter: Number of passes that smooth indirect light between hits of one surface, over 3, 9 and 27 pixels. 0:
            none.
        exact: Follow a path from each hit instead of every ray that reads a cell: for references, with many hits. No
            cells are built and nothing is smoothed, so the mean is right, and pixels are noisy.
    """

    method: Literal["obscurance", "cells"] = "cells"
    cell: float | None = optional("a 30th of the median length of obscurance rays to the first surface", gt=0, le=1e12)
    samples: int = Field(default=2**20, ge=1024, le=2**24)
    filter: int = Field(default=2, ge=0, le=3)

    exact: bool = False

    def problems(self) -> Problems:
        """Check that settings of cells have cells."""
        problem = ""
        if self.method == "obscurance":
            problem = 'expected method = "cells" next to it: obscurances have no cells'
        elif self.exact:
            problem = "expected no value, as exact = true builds no cells and smooths nothing; remove one of the two"
        for key in sorted(self.model_fields_set & {"cell", "samples", "filter"}) if problem else ():
            yield (key,), problem
        if self.method == "obscurance" and self.exact:
            yield ("exact",), 'expected false, or method = "cells" next to it: it replaces the cells'


class AmbientTable(Table):
    """The ambient light I_A of each light position, the level of all indirect light.

    Attributes:
        intensity: Fixes I_A for every light position, as a radiance, W/(m2 sr), instead of `paths`.
        paths: Number of walks that gather the light that arrives at what the cameras see.
    """

    intensity: Emission | None = optional("measured")
    paths: int | None = optional("as many as a standard error of 1 % needs", ge=1, le=2**24)

    @field_validator("paths")
    @classmethod
    def _not_fixed(cls, value: object, info: ValidationInfo) -> object:
        if value is not None and info.data.get("intensity") is not None:
            fail([((), "expected no value, because `intensity` fixes the ambient light; remove one of the two")])
        return value


class SpecularTable(Table):
    """Mirror reflection.

    Attributes:
        depth: Longest chain of mirror reflections. 0: mirrors are black.
        hits: Native hits per pixel that sees a mirror; what a mirror shows is never reused.
    """

    depth: int = Field(default=4, ge=0, le=64)
    hits: int = optional(
        '(2 n_r + 1) times `samples.hits`; 7 times with n_r = "auto", 14 with hits = "auto"', 0, ge=1, le=MOST_HITS
    )
