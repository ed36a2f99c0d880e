"""The scene as the slow twin sees it: rays one at a time through embreex, surfaces in float64."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from framearray_cli.scene.scene import Scene

OFFSET = 16 * 2.0**-23  # a ray starts this share of its triangle's largest coordinate above it


@dataclass
class Points:
    """First hits of n rays; where `surface` is False a ray left the scene, and only `incoming` and the keys count.

    `place` is barycentric, in the triangle.
    """

    surface: Any
    position: Any
    geometric: Any
    shading: Any
    lift: Any
    reflectivity: Any
    specular: Any
    incoming: Any
    key: Any
    pixel: Any
    origin: Any
    triangle: Any
    place: Any

    def __getitem__(self, chosen: Any) -> "Points":
        chosen = np.arange(len(self.surface))[chosen]
        arrays = {name: np.asarray(values)[chosen] for name, values in vars(self).items() if name != "key"}
        return Points(key=[self.key[i] for i in chosen], **arrays)

    @property
    def escape(self) -> Any:
        """Unit directions in which rays left."""
        return unit(self.incoming)

    @property
    def start(self) -> Any:
        """Where rays that leave the points start."""
        return self.position + self.lift[:, None] * self.geometric

    def __len__(self) -> int:
        return len(self.surface)


def unit(vectors: Any) -> Any:
    """Vectors of length 1."""
    return vectors / np.sqrt((vectors**2).sum(axis=-1, keepdims=True))


def dot(a: Any, b: Any) -> Any:
    """Row by row."""
    return (a * b).sum(axis=-1)


class Model:
    """A scene in embreex, and its materials."""

    def __init__(self, scene: Scene) -> None:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        assert scene.n_opaque == len(scene.corners), "the twin knows no alpha masks"
        self.scene = scene
        self._embree = EmbreeScene()
        self._mesh = TriangleMesh(self._embree, scene.corners)
        self.rays = 0

    def _run(self, origins: Any, dirs: Any, far: Any, query: str, output: int) -> Any:
        far = np.minimum(np.broadcast_to(far, len(origins)), 1e37).astype(np.float32)
        self.rays += len(origins)
        return self._embree.run(origins.astype(np.float32), dirs.astype(np.float32), far, query=query, output=output)

    def first(self, origins: Any, dirs: Any, far: Any = np.inf) -> tuple[Any, Any, Any]:
        """First triangle or -1, its barycentric (u, v), and the distance in lengths of the direction."""
        if not len(origins):
            return np.zeros(0, int), np.zeros((0, 2)), np.zeros(0)
        out = self._run(origins, dirs, far, "INTERSECT", 1)
        uv = np.where(out["primID"][:, None] >= 0, np.stack([out["u"], out["v"]], axis=1), 0)  # of misses not set
        return out["primID"], uv.astype(np.float64), out["tfar"].astype(np.float64)

    def blocked(self, origins: Any, dirs: Any, far: Any) -> Any:
        """Whether a surface lies within `far` lengths of the direction."""
        if not len(origins):
            return np.zeros(0, bool)
        return self._run(origins, dirs, far, "OCCLUDED", 0) == 0

    def mix(self, table: Any, triangle: Any, uv: Any) -> Any:
        """Interpolate corner values (n_triangles, 3, k)."""
        weights = np.column_stack([1 - uv.sum(axis=1), uv])
        return (weights[:, :, None] * table[triangle].astype(np.float64)).sum(axis=1)

    def part(self, factor: Any, texture: Any, triangle: Any, uv: Any, look_up: Any = None) -> Any:
        """Reflectivity of the diffuse or the mirror part: material times texture times corner colour."""
        look_up = look_up or self.texture
        material = self.scene.material[triangle]
        colour = factor[material].astype(np.float64)
        textures = texture[material]
        for number in np.unique(textures[textures >= 0]):
            rows = textures == number
            colour[rows] *= look_up(number, self.mix(self.scene.uvs, triangle[rows], uv[rows]))
        return colour * self.mix(self.scene.colours, triangle, uv) if len(self.scene.colours) else colour

    def texels(self, number: int) -> Any:
        """Linear RGB of a texture (height, width, 3)."""
        first, width, height = (int(x) for x in self.scene.textures[number])
        code = self.scene.texels[first : first + width * height, :3].reshape(height, width, 3) / 255
        return np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)

    def nearest(self, number: int, uv: Any) -> Any:
        """Linear RGB of the texels, repeating, that texture coordinates (n, 2), v upwards, lie in."""
        linear = self.texels(number)
        height, width = linear.shape[:2]
        return linear[height - 1 - np.floor(uv[:, 1] % 1 * height).astype(int), (uv[:, 0] % 1 * width).astype(int)]

    def texture(self, number: int, uv: Any) -> Any:
        """Bilinear and repeating: linear RGB at texture coordinates (n, 2), v upwards."""
        return self.blend(self.texels(number), uv)

    def blend(self, linear: Any, uv: Any) -> Any:
        """Bilinear and repeating: a table (height, width, 3) at texture coordinates; texels are centred at halves."""
        height, width = linear.shape[:2]
        place = np.stack([uv[:, 0] * width, -uv[:, 1] * height], axis=1) - 0.5  # row 0 is on top, where v is 1
        low = np.floor(place).astype(int)
        right, down = (place - low).T[:, :, None]

        def at(i: int, j: int) -> Any:
            return linear[(low[:, 1] + j) % height, (low[:, 0] + i) % width]

        top = at(0, 0) * (1 - right) + at(1, 0) * right
        bottom = at(0, 1) * (1 - right) + at(1, 1) * right
        return top * (1 - down) + bottom * down

    def mapped(self, triangle: Any, uv: Any, geometric: Any, shading: Any) -> Any:
        """Shading normals (n, 3), turned by normal maps; where these point below the triangle, up to its plane."""
        scene, turned = self.scene, shading.copy()
        numbers = scene.normal_texture[scene.material[triangle]]
        for number in np.unique(numbers[numbers >= 0]):
            rows = np.flatnonzero((numbers == number) & scene.tangents[triangle].any(axis=(1, 2)))
            on, at, up = triangle[rows], uv[rows], geometric[rows]
            first, width, height = (int(x) for x in scene.textures[number])
            codes = scene.texels[first : first + width * height, :3].reshape(height, width, 3) / 255 * 2 - 1
            x, y, z = self.blend(codes, self.mix(scene.normal_uvs, on, at)).T[:, :, None]
            scale = scene.normal_scale[scene.material[on]].astype(np.float64)[:, None]
            tangent, normal = self.mix(scene.tangents, on, at), self.mix(scene.normals, on, at)
            along, across = tangent[:, :3], tangent[:, 3:] * np.cross(normal, tangent[:, :3])
            found = unit(scale * x * along + scale * y * across + z * normal)
            found *= np.where(dot(normal, shading[rows]) < 0, -1, 1)[:, None]
            turned[rows] = unit(found - np.minimum(dot(found, up), 0)[:, None] * up)
        return turned

    def diffuse(self, triangle: Any, uv: Any) -> Any:
        """Diffuse reflectivity (n, 3)."""
        return self.part(self.scene.reflectivity, self.scene.reflectivity_texture, triangle, uv)

    def mirror(self, triangle: Any, uv: Any) -> Any:
        """Mirror reflectivity (n, 3)."""
        return self.part(self.scene.specular, self.scene.specular_texture, triangle, uv)

    def total(self, triangle: Any, uv: Any) -> Any:
        """Diffuse and mirror reflectivity together (n, 3), of the nearest texel, as obscurance takes it."""
        scene = self.scene
        return self.part(scene.reflectivity, scene.reflectivity_texture, triangle, uv, self.nearest) + self.part(
            scene.specular, scene.specular_texture, triangle, uv, self.nearest
        )

    def look(self, origins: Any, dirs: Any, key: Any, pixel: Any) -> Points:
        """Everything about the first hits of rays (n, 3), (n, 3)."""
        triangle, uv, _ = self.first(origins, dirs)
        surface = triangle >= 0
        triangle = np.where(surface, triangle, 0)
        corner = self.scene.corners[triangle].astype(np.float64)
        geometric = unit(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]))
        geometric *= np.where(dot(geometric, dirs) > 0, -1, 1)[:, None]
        shading = geometric
        if len(self.scene.normals):
            shading = unit(self.mix(self.scene.normals, triangle, uv))
            shading = shading * np.where(dot(shading, geometric) < 0, -1, 1)[:, None]
        if len(self.scene.tangents):
            shading = self.mapped(triangle, uv, geometric, shading)
        return Points(
            surface=surface,
            position=self.mix(self.scene.corners, triangle, uv),
            geometric=geometric,
            shading=shading,
            lift=OFFSET * abs(corner).max(axis=(1, 2)),
            reflectivity=self.diffuse(triangle, uv) * surface[:, None],
            specular=self.mirror(triangle, uv) * surface[:, None],
            incoming=dirs,
            key=key,
            pixel=pixel,
            origin=origins,
            triangle=triangle,
            place=uv,
        )
