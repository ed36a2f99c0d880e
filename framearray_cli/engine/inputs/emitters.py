"""Surfaces that shine: the triangles of materials that sources of type "mesh" name.

A hit draws points y of each such source, by the area of its triangles times how bright they are. The irradiance by a
point y is

    L(y) cos(theta) cos(theta_l) / (d^2 p(y))        theta at the surface, theta_l at y, d between them

with p(y) the density of the draw per area. The hit keeps one of `CANDIDATES` points, with a chance proportional to this
value without L, and takes the mean value of them all for it: on average the same light [Talbot05], and only where all
points show their back is it 0. Neither y nor the shadow ray to it depends on the light position, so one ray
serves them all. The strength of a mesh in `LightArrays` is the radiance that multiplies its texture.

Surfaces that emit light although no source of the job names them (`Glow`) are seen, and light nothing.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from framearray_cli.base.arrays import Float32, Float64, Int32, Real, Rgb, Triple
from framearray_cli.scene.files.model import UV_SET
from framearray_cli.scene.merge import geometric_normals
from framearray_cli.scene.paths.paths import Lights
from framearray_cli.scene.scene import Scene

from ..kernels.bundle import bundle
from ..kernels.kernel import inlined
from ..kernels.simd import gather, integers, reals, select, sqrt
from .random import EMITTERS, SOURCES, r2, random_word
from .surfaces import NO_SURFACES, Surfaces, factors_at, position_at, surfaces

MANY = 1 << 24  # random numbers that choose a triangle are below
# Points of a triangle, per side, at which its texture is read for the draw.
TEXTURE_POINTS = 8
# A triangle is drawn as if it were at least this bright, in units of the mean: a texture is known at some points only.
FAINTEST = 0.05
# Points of which a hit keeps one. Half of a closed surface faces away from any place.
CANDIDATES = 4
# How far apart they are in the table: the golden ratio. Parts of models often lie a power of two of triangles apart.
APART = round((math.sqrt(5) - 1) / 2 * MANY)


@bundle
class Emitters(NamedTuple):
    """The triangles of all meshes that shine; `NONE` where there are none.

    Attributes:
        span: (n_sources, 2) a source's first row and number of rows in the arrays of triangles; 0 of other sources.
        back: (n_sources,) -1 where both sides shine, 1 where the front does.
        triangle: (n,) number in the scene.
        end: (n,) the first number, of `MANY`, that no longer chooses the triangle.
        normal: (n, 3) unit normal of the front.
        weight: (n,) 1 / p(y).
        source: (n_materials,) the source that a material belongs to, or -1.
        texture: (n_materials,) texture of its light, or -1.
        surfaces: of the scene.
    """

    span: Int32
    back: Float32
    triangle: Int32
    end: Int32
    normal: Float32
    weight: Float32
    source: Int32
    texture: Int32
    surfaces: Surfaces

    @property
    def coloured(self) -> bool:
        """True if the colour of light differs from place to place."""
        return bool((self.texture[self.source >= 0] >= 0).any()) if self.span.size else False


_NO_NUMBERS, _NO_REALS = np.empty(0, np.int32), np.empty(0, np.float32)
NONE = Emitters(
    np.empty((0, 2), np.int32), _NO_REALS, _NO_NUMBERS, _NO_NUMBERS, np.empty((0, 3), np.float32), _NO_REALS,
    _NO_NUMBERS, _NO_NUMBERS, NO_SURFACES,
)  # fmt: skip


def emitters(lights: Lights, scene: Scene) -> Emitters:
    """Find the triangles of all meshes that shine, and how often a hit draws each."""
    if all(source.emitter is None for source in lights.sources):
        return NONE
    n = len(lights.sources)
    span, back = np.zeros((n, 2), np.int32), np.ones(n, np.float32)
    names = np.array(scene.material_names)
    source = np.full(len(names), -1, np.int32)
    texture = np.full(len(names), -1, np.int32)
    rows: list[Any] = []
    ends: list[Any] = []
    weights: list[Any] = []
    for s, path in enumerate(lights.sources):
        if path.emitter is None:
            continue
        own = names == path.emitter.material
        source[own] = s
        if not path.emitter.flat:
            texture[own] = scene.emission_texture[own]
        back[s] = -1.0 if path.emitter.two_sided else 1.0
        found = np.flatnonzero(own[scene.material]).astype(np.int32)
        end, weight = _draw(scene, found, texture)
        span[s] = sum(map(len, rows)), len(found)
        rows, ends, weights = [*rows, found], [*ends, end], [*weights, weight]
    triangle = np.concatenate(rows)
    normal = geometric_normals(scene.corners[triangle])
    return Emitters(
        span, back, triangle, np.concatenate(ends), normal, np.concatenate(weights), source, texture, surfaces(scene)
    )  # fmt: skip


def _draw(scene: Scene, triangles: Int32, texture: Int32) -> tuple[Int32, Float32]:
    """`Emitters.end` and `Emitters.weight` of the triangles of a source."""
    corners = scene.corners[triangles].astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    bright = brightness(scene, triangles, texture[scene.material[triangles]])
    mean = (area * bright).sum() / area.sum()
    share = area * np.maximum(bright, FAINTEST * mean) if mean > 0 else area
    end = np.round(np.cumsum(share) / share.sum() * MANY).astype(np.int32)
    chance = np.diff(end, prepend=0) / MANY
    weight = np.divide(area, chance, out=np.zeros_like(area), where=chance > 0)
    return end, weight.astype(np.float32)


def brightness(scene: Scene, triangles: Int32, texture: Int32) -> Float64:
    """The mean of the texture of each triangle over its channels, 1 without one."""
    found = np.ones(len(triangles))
    if not len(scene.uvs):
        return found
    steps = (np.arange(TEXTURE_POINTS) + 0.5) / TEXTURE_POINTS
    u, v = (grid.ravel() for grid in np.meshgrid(steps, steps))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    linear = surfaces(scene).linear.astype(np.float64)
    for number in np.unique(texture[texture >= 0]):
        own = np.flatnonzero(texture == number)
        first, width, height = scene.textures[number]
        row = int(scene.samplers[number]) >> UV_SET if len(scene.samplers) else 0
        uvs = scene.uvs[triangles[own] + row * len(scene.corners)].astype(np.float64)
        at = (1 - u - v)[:, None] * uvs[:, None, 0] + u[:, None] * uvs[:, None, 1] + v[:, None] * uvs[:, None, 2]
        at -= np.floor(at)
        x = np.minimum((at[..., 0] * width).astype(np.int64), width - 1)
        y = np.minimum(((1 - at[..., 1]) * height).astype(np.int64), height - 1)
        found[own] = linear[scene.texels[first + y * width + x, :3]].mean(axis=(1, 2))
    return found


class EmitterPoint(NamedTuple):
    """A point y of a mesh.

    Attributes:
        row: of its triangle in `Emitters`.
        u, v: barycentric.
    """

    row: int
    u: Real
    v: Real


@inlined
def kept_point(
    emitters: Emitters, key: np.uint64, s: int, p: Triple, g: Triple, m: Triple
) -> tuple[EmitterPoint, Triple, Real]:
    """The point y of mesh s that the hit of a random key keeps, or the hits in lanes.

    Args:
        p, g, m: points P, geometric and shading normals.

    Returns:
        y, the vector from P to it, and the mean factor of all points drawn, see `emitter_sample`.
    """
    one, tiny = np.float32(1.0), np.float32(1e-30)
    word, place = random_word(key, EMITTERS + s), random_word(key, SOURCES + s)
    choice = reals(integers(word >> np.uint64(40)) & np.int32(MANY - 1)) * np.float32(1.0 / MANY)
    kept = emitter_point(emitters, word, place, s, 0)
    x, y, z, total = emitter_sample(emitters, s, kept, p, g, m)
    for i in range(1, CANDIDATES):
        other = emitter_point(emitters, word, place, s, i)
        ox, oy, oz, factor = emitter_sample(emitters, s, other, p, g, m)
        total = total + factor
        share = factor / select(total > tiny, total, tiny)
        taken = choice < share
        # what is left of a random number that has decided is a random number
        rest = one - share
        choice = select(taken, choice / select(taken, share, one), (choice - share) / select(taken, one, rest))
        kept = EmitterPoint(
            select(taken, other.row, kept.row), select(taken, other.u, kept.u), select(taken, other.v, kept.v)
        )
        x, y, z = select(taken, ox, x), select(taken, oy, y), select(taken, oz, z)
    return kept, (x, y, z), total * np.float32(1.0 / CANDIDATES)


@inlined
def emitter_point(emitters: Emitters, word: np.uint64, place: np.uint64, s: int, i: int) -> EmitterPoint:
    """Point i of mesh s that a hit draws: the triangle by the bits of a random word, its place in that by another's."""
    one = np.float32(1.0)
    wanted = ((integers(word) >> np.int32(8)) + np.int32(i) * np.int32(APART)) & np.int32(MANY - 1)
    # bisection: the first row whose end lies beyond the number
    low = wanted * np.int32(0) + emitters.span[s, 0]
    count = emitters.span[s, 1]
    while count > 1:
        half = count // 2
        beyond = gather(emitters.end, low + np.int32(half - 1)) > wanted
        low = select(beyond, low, low + np.int32(half))
        count -= half
    a, b = r2(place, i)
    root = sqrt(a)
    return EmitterPoint(low, root * (one - b), root * b)


@inlined
def emitter_sample(
    emitters: Emitters, s: int, at: EmitterPoint, p: Triple, g: Triple, m: Triple
) -> tuple[Real, Real, Real, Real]:
    """Vectors from points P to points y of mesh s, and the factors cos(theta) cos(theta_l) / (d^2 p(y)).

    The factor is 0 where y lies behind either normal of P, or shows P no bright side.

    Args:
        p, g, m: points, geometric and shading normals.
    """
    nothing, one = np.float32(0.0), np.float32(1.0)
    x, y, z = position_at(emitters.surfaces, gather(emitters.triangle, at.row), at.u, at.v)
    x, y, z = x - p[0], y - p[1], z - p[2]
    first = at.row * np.int32(3)
    nx, ny = gather(emitters.normal, first), gather(emitters.normal, first + np.int32(1))
    nz = gather(emitters.normal, first + np.int32(2))
    square = x * x + y * y + z * z
    inverse = one / select(square > nothing, square, one)
    # d cos(theta_l) in front of y, or behind it for a back that shines
    height = -(x * nx + y * ny + z * nz)
    behind = emitters.back[s] * height
    height = select(height > behind, height, behind)
    cosine = x * m[0] + y * m[1] + z * m[2]
    in_front = (cosine > nothing) & (x * g[0] + y * g[1] + z * g[2] > nothing) & (height > nothing)
    factor = cosine * height * inverse * inverse * gather(emitters.weight, at.row)
    return x, y, z, select(in_front, factor, nothing)


@inlined
def emitted_colour(emitters: Emitters, at: EmitterPoint) -> Triple:
    """The texture of a mesh at its points y; 1 without."""
    triangle = gather(emitters.triangle, at.row)
    texture = gather(emitters.texture, gather(emitters.surfaces.material, triangle))
    return factors_at(emitters.surfaces, texture, triangle, at.u, at.v)[:3]


@bundle
class Glow(NamedTuple):
    """Surfaces that emit light and are not sources: they are seen, and light nothing.

    Attributes:
        emitters: with one "source" per material, and no triangles to draw points of; NONE where nothing glows.
        radiance: (n, 3) of each, which multiplies its texture.
    """

    emitters: Emitters
    radiance: Rgb


NO_GLOW = Glow(NONE, np.empty((0, 3), np.float32))


def glow(scene: Scene, lights: Lights, *, as_file: bool) -> Glow:
    """Find the materials of a scene that emit light without a source; none unless surfaces follow the file."""
    if not as_file:
        return NO_GLOW
    sources = {source.emitter.material for source in lights.sources if source.emitter}
    named = np.array([name in sources for name in scene.material_names])
    rows = np.flatnonzero((scene.emission > 0).any(axis=1) & ~named & np.isin(np.arange(len(named)), scene.material))
    if not len(rows):
        return NO_GLOW
    source = np.full(len(named), -1, np.int32)
    source[rows] = np.arange(len(rows))
    back = np.where(scene.one_sided[rows] > 0, 1, -1).astype(np.float32)
    seen = NONE._replace(
        back=back, source=source, texture=scene.emission_texture, surfaces=surfaces(scene),
        normal=np.empty((0, 3), np.float32), span=np.zeros((len(rows), 2), np.int32),
    )  # fmt: skip
    return Glow(seen, np.ascontiguousarray(scene.emission[rows]))


def glowing(glow: Glow) -> Int32:
    """Return the numbers of the materials."""
    return np.flatnonzero(glow.emitters.source >= 0).astype(np.int32)


def glows(glow: Glow) -> bool:
    """Return True if there are such surfaces."""
    return len(glow.radiance) > 0
