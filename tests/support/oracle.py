"""The slow twin of the engine: single images of a job, as plain as possible.

It shares no code with the kernels, only their definitions: the job, the scene's arrays, the eyes and lights in
float64, the measured ambient light, and which random number is for what. There is no packet, batch, window or
sorting: rays go through embreex's own API, which calls Embree once per ray; the rest is numpy in float64, one line per
formula. Reuse is done by brute force: every hit of every eye of the window is projected into the frame and weighed.

    image[c, l] = sum w L / sum w + what mirrors show / their native hits,    L = R (E[l] / pi + I_A[l] W + S)

Letters: docs/method/algorithm.md.
"""

from fractions import Fraction
from typing import Any

import numpy as np

from framearray_cli.engine.terms.ambient.intensity import Ambient
from framearray_cli.render.prepare import Prepared
from support import oracle_lens as lenses
from support import oracle_random as rnd
from support.area_twin import PARTS, area_weights
from support.oracle_scene import Model, Points, dot, unit

SHADOW_END = 1 - 1e-4  # a shadow ray ends this share of its length before the light


class Oracle:
    """Renders single images of a job."""

    def __init__(self, inputs: Prepared, ambient: Ambient) -> None:
        self.inputs, self.job, self.ambient = inputs, inputs.job, ambient
        self.model = Model(inputs.scene)
        self.background = np.array(self.job.scene.background)
        self.width, self.height = self.job.camera.resolution
        self.n_r, self.n_c = self.job.reuse.n_r, 1 if inputs.still else inputs.n_cameras

    def image(self, c: int, l: int) -> Any:
        """(height, width, 3) radiance of camera c under light l."""
        total, weights, count = np.zeros((self.n_pixels, 3)), np.zeros(self.n_pixels), np.zeros(self.n_pixels, int)
        parts = []  # of all hits: part of the frame that each lies in, balance weight, radiance
        for k in self.window(c):
            hits = self.native(k)
            pixel, weight = self.use(c, k, hits)
            used = np.flatnonzero(pixel >= 0)
            radiance = self.radiance(hits[used], l)
            np.add.at(total, pixel[used], weight[used, None] * radiance)
            np.add.at(weights, pixel[used], weight[used])
            np.add.at(count, pixel[used], 1)
            parts.append((*self.parts(c, hits[used], pixel[used]), weight[used], radiance))
        if self.job.reuse.weights == "area":
            column, row, balance, radiance = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
            for p, near, weight in area_weights(column, row, balance, (self.width, self.height)):
                total[p], weights[p] = weight @ radiance[near], 1
        holes = self.samples(c, np.flatnonzero(count == 0), rnd.HOLE)
        if len(holes):  # a pixel without hits gets one of its own
            total[holes.pixel], weights[holes.pixel], count[holes.pixel] = self.radiance(holes, l), 1, 1
        self.count = count
        picture = total / weights[:, None]
        if self.inputs.scene.has_mirrors and self.job.specular.depth:
            picture += self.mirrors(c, l, holes)
        return picture.reshape(self.height, self.width, 3)

    # -- samples

    @property
    def n_pixels(self) -> int:
        return self.width * self.height

    def window(self, c: int) -> range:
        """Eyes whose hits may be used in frame c: of the path, which continues beyond its ends, mirrored."""
        return range(1) if self.inputs.still else range(c - self.n_r, c + self.n_r + 1)

    def frame(self, eye: int) -> int:
        """The frame that an eye beyond the ends repeats."""
        there_and_back = [*range(self.n_c), *reversed(range(self.n_c))]
        return there_and_back[eye % len(there_and_back)]

    def twins(self, k: int) -> list[int]:
        """All eyes that repeat frame k, and k itself, the nearest first."""
        every = range(1) if self.inputs.still else range(-self.n_r, self.n_c + self.n_r)
        return sorted((eye for eye in every if self.frame(eye) == k), key=lambda eye: abs(eye - k))

    @property
    def per_pixel(self) -> float:
        """Native hits per pixel of an eye."""
        return self.job.samples.hits * (2 * self.n_r + 1 if self.inputs.still else 1)

    def sparse_pixels(self, eye: int) -> Any:
        """Pixels with one hit more than the others where hits per pixel are no whole number: n of every m pixels,
        shifted by some pixels from row to row and by one from eye to eye."""
        share = Fraction(self.per_pixel).limit_denominator(8) % 1
        n, m = share.numerator, share.denominator
        x, y = np.meshgrid(np.arange(self.width), np.arange(self.height))
        turn = (x + max(1, round(0.382 * m)) * y + eye) % m
        return np.flatnonzero(turn.reshape(-1) < n)

    def axes(self, k: int) -> tuple[Any, Any, Any, Any]:
        """Position, right, up and forward of eye k, centred like the scene."""
        matrix = self.inputs.eyes.world_from_camera[k]
        return matrix[:3, 3] - self.inputs.scene.centre, matrix[:3, 0], matrix[:3, 1], -matrix[:3, 2]

    def rays_through(self, k: int, xy: Any) -> tuple[Any, Any]:
        """Origins and directions of rays through image positions (n, 2), pixels from the top left."""
        return lenses.rays(self.lens(k), (self.width, self.height), self.axes(k), xy)

    def lens(self, k: int) -> Any:
        """The lens of eye k."""
        return self.inputs.eyes.lenses[k]

    def native(self, eye: int) -> Points:
        """All native hits of an eye; eyes that repeat a frame use its next samples."""
        whole, pixels, k = int(self.per_pixel), np.arange(self.n_pixels), self.frame(eye)
        some, first = self.sparse_pixels(eye), self.twins(k).index(eye) * int(np.ceil(self.per_pixel))
        pixel = np.concatenate([np.repeat(pixels, whole), some])
        sample = np.concatenate([np.tile(np.arange(whole), len(pixels)), np.full(len(some), whole)])
        return self.samples(k, pixel, first + sample)

    def samples(self, k: int, pixel: Any, sample: Any) -> Points:
        """One hit of eye k for each (pixel, sample)."""
        sample = np.broadcast_to(sample, len(pixel))
        shared = rnd.bits(rnd.keys(self.job.seed, k, pixel, np.full(len(pixel), rnd.WHOLE_PIXEL)), rnd.PIXEL)
        corner = np.stack([pixel % self.width, pixel // self.width], axis=1)
        origins, dirs = self.rays_through(k, corner + rnd.points(shared, sample, rnd.sequence()))
        return self.model.look(origins, dirs, rnd.keys(self.job.seed, k, pixel, sample), pixel)

    # -- radiance of hits

    def radiance(self, hits: Points, l: int) -> Any:
        """(n, 3): R (E[l] / pi + I_A[l] W + S), or the background where a ray left the scene."""
        obscurance, sky = self.obscurance(hits)
        ambient = self.ambient.intensity[l].astype(np.float64)
        seen = hits.reflectivity * (self.irradiance(hits, l) / np.pi + ambient * obscurance + sky)
        return np.where(hits.surface[:, None], seen, self.background)

    def irradiance(self, hits: Points, l: int) -> Any:
        """(n, 3) E[l]: every source, where it is in front of both normals and nothing blocks it."""
        result = np.zeros((len(hits), 3))
        for source in self.inputs.lights.sources:
            if source.kind == "point":
                way = source.vector[l] - self.inputs.scene.centre - hits.position
                cosine, far = dot(hits.shading, unit(way)) / dot(way, way), SHADOW_END
            else:
                way = np.broadcast_to(-source.vector[l], hits.position.shape)
                cosine, far = dot(hits.shading, way), np.inf
            lit = np.flatnonzero(hits.surface & (cosine > 0) & (dot(hits.geometric, way) > 0))
            aim = way - (hits.start - hits.position) if source.kind == "point" else way
            lit = lit[~self.model.blocked(hits.start[lit], aim[lit], far)]
            result[lit] += cosine[lit, None] * source.intensity[l]
        return result

    def rho(self, x: Any) -> Any:
        """The falloff at x = d / d_max."""
        tau = self.job.obscurance.tau
        return {
            "sqrt": lambda: np.sqrt(x),
            "linear": lambda: x,
            "cbrt": lambda: np.cbrt(x),
            "exponential": lambda: (1 - np.exp(-tau * x)) / (1 - np.exp(-tau)),
            "constant": lambda: 0 * x,
        }[self.job.obscurance.falloff]()

    def gather_rays(self, hits: Points) -> tuple[Any, Any, Any]:
        """The hit that each of n cosine-distributed rays per hit leaves, its number there, and its direction."""
        n = self.job.samples.obscurance
        owner, ray = np.repeat(np.arange(len(hits)), n), np.tile(np.arange(n), len(hits))
        words = rnd.bits(hits.key, rnd.HEMISPHERE)
        dirs = rnd.hemisphere(hits.shading[owner], rnd.points([words[i] for i in owner], ray, rnd.lattice(n)))
        g = hits.geometric[owner]
        dirs -= 2 * np.minimum(dot(dirs, g), 0)[:, None] * g  # up from below the triangle
        return owner, ray, dirs

    def obscurance(self, hits: Points) -> tuple[Any, Any]:
        """W and S of hits, (n, 3) each: means over cosine-distributed rays."""
        n, d_max = self.job.samples.obscurance, self.job.obscurance.range
        sky = self.job.obscurance.outside == "background"
        owner, _, dirs = self.gather_rays(hits)
        triangle, uv, distance = self.model.first(hits.start[owner], dirs, np.inf if sky else d_max)
        near = (triangle >= 0) & (distance < d_max)
        brought = np.tile(self.ambient.reflectivity.astype(np.float64), (len(owner), 1))
        met, at = triangle[near], uv[near]
        brought[near] = self.rho(distance[near] / d_max)[:, None] * self.model.total(met, at)
        light = np.zeros((len(owner), 3))
        if sky:
            brought[triangle < 0] = 0
            light[triangle < 0] = self.background
        return brought.reshape(-1, n, 3).mean(axis=1), light.reshape(-1, n, 3).mean(axis=1)

    # -- mirrors

    def mirrors(self, c: int, l: int, holes: Points) -> Any:
        """(n_pixels, 3): mean of what the native hits of each pixel show by reflection."""
        hits = [self.native(c), holes]
        looks = self.model.look(*self.rays_through(c, self.centres), key=[0] * self.n_pixels, pixel=None)
        seen = (looks.specular > 0).any(axis=1).reshape(self.height, self.width)
        wide = np.pad(seen, 1)
        near = sum(wide[i : i + self.height, j : j + self.width] for i in range(3) for j in range(3)).reshape(-1) > 0
        first = len(self.twins(c)) * int(np.ceil(self.per_pixel))  # samples that no pixel has used
        more = range(first, first + max(self.job.specular.hits - int(self.per_pixel), 0))
        hits += [self.samples(c, np.flatnonzero(near), sample) for sample in more]
        count = sum(np.bincount(points.pixel, minlength=self.n_pixels) for points in hits)
        return sum(self.reflected(points, l) for points in hits) / np.maximum(count, 1)[:, None]

    @property
    def centres(self) -> Any:
        p = np.arange(self.n_pixels)
        return np.stack([p % self.width, p // self.width], axis=1) + 0.5

    def reflected(self, hits: Points, l: int) -> Any:
        """(n_pixels, 3): sum of what hits show by reflection, followed to the job's depth."""
        total, through = np.zeros((self.n_pixels, 3)), np.ones((len(hits), 3))
        for _ in range(self.job.specular.depth):
            mirror = np.flatnonzero((hits.specular > 0).any(axis=1))
            hits, through = hits[mirror], through[mirror] * hits.specular[mirror]
            if not len(hits):
                break
            away = reflect(hits.incoming, hits.shading)
            into = dot(away, hits.geometric) <= 0
            away[into] = reflect(hits.incoming, hits.geometric)[into]
            hits = self.model.look(hits.start, away, rnd.mix(hits.key), hits.pixel)
            np.add.at(total, hits.pixel, through * self.radiance(hits, l))
        return total

    # -- reuse

    def use(self, j: int, eye: int, hits: Points) -> tuple[Any, Any]:
        """Pixel of frame j that each native hit of an eye falls into (-1: none), and its weight there."""
        if len(self.window(j)) == 1:
            return hits.pixel, np.ones(len(hits))
        k = self.frame(eye)
        pixel, density = self.seen(j, k, hits)
        if self.job.reuse.weights == "average":
            return pixel, np.ones(len(hits))
        total = sum(self.per_pixel * self.seen(self.frame(i), k, hits)[1] for i in self.window(j))
        return pixel, np.where(pixel >= 0, density, 0) / np.where(total > 0, total, 1)

    def parts(self, j: int, hits: Points, pixel: Any) -> tuple[Any, Any]:
        """Column and row of the part of frame j in which each hit lies, 16 x 16 per pixel; `pixel` sees the hit."""
        way = lenses.ways(self.lens(j), self.axes(j), hits)
        x, y = lenses.places(self.lens(j), (self.width, self.height), self.axes(j), way)
        corners = pixel % self.width, pixel // self.width
        return tuple(
            PARTS * corner + np.clip(np.floor(PARTS * (at - corner)), 0, PARTS - 1).astype(int)
            for at, corner in zip((x, y), corners, strict=True)
        )

    def seen(self, j: int, k: int, hits: Points) -> tuple[Any, Any]:
        """Pixel of eye j that sees each native hit of eye k, or -1, and the density p_j there."""
        lens, axes, size = self.lens(j), self.axes(j), (self.width, self.height)
        x, y = lenses.places(lens, size, axes, lenses.ways(lens, axes, hits))
        density, ahead = lenses.densities(lens, size, axes, hits, y)
        if j == k:  # its own eye has seen it; only rounding could say otherwise
            return hits.pixel, density
        inside = ahead & (x >= 0) & (x < self.width) & (y >= 0) & (y < self.height) & (density > 0)
        to_eye, start = lenses.ways_out(lens, axes, hits)
        for rows, origins, dirs, far in (
            (np.flatnonzero(inside & hits.surface), hits.start, to_eye, 1.0),
            (np.flatnonzero(inside & ~hits.surface), start, hits.escape, np.inf),
        ):
            inside[rows] = ~self.model.blocked(origins[rows], dirs[rows], far)
        pixel = np.where(inside, np.floor(np.where(inside, y, 0)) * self.width + np.floor(np.where(inside, x, 0)), -1)
        return pixel.astype(int), np.where(inside, density, 0)


def reflect(incoming: Any, normal: Any) -> Any:
    """Directions mirrored at normals."""
    return incoming - 2 * dot(incoming, normal)[:, None] * normal
