"""Scene: the plain arrays that kernels read, centred in float64 before they become float32.

Textures get smaller copies for surfaces far away [Williams83], each half as wide and high as the one before; means are
of linear light.
"""

from collections.abc import Collection, Container, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Bytes, Corners, CornerUvs, Float32, Float64, Int32, Rgb, box_of
from framearray_cli.base.colour import linear_from_srgb8, srgb8_from_linear
from framearray_cli.base.errors import SceneError
from framearray_cli.base.units import counted
from framearray_cli.job.job import MaterialTable

from .files import Material, Meshes, Notes, read_meshes
from .files.materials import override_materials, with_something_shown
from .files.model import WRAPS
from .files.textures import different
from .merge import (
    add_untextured_variants,
    dropped_text,
    is_glass,
    merge,
    select_triangles,
    unit_normals,
    uv_set,
    wrap_uvs,
)
from .panes import select_panes
from .vectors import rows_of

FAR = 128.0  # sizes of a scene from which positions are relative to a point near it
MOST_LEVELS = 16  # of a texture 32768 texels wide
_AT_ONCE = 1 << 16  # numbers that are averaged together; few enough to stay in a cache


def add_mips(textures: Sequence[Bytes], wanted: Collection[int]) -> tuple[list[Bytes], Int32]:
    """Make the smaller copies of some textures.

    Args:
        textures: (height, width, 4) each, colours sRGB encoded, alpha linear.
        wanted: numbers of those that colour surfaces.

    Returns:
        The copies, whose texels follow all textures' in this order; and (n, MOST_LEVELS, 3) first texel, width and
        height of each copy of each texture. Level 0 is the texture; behind its last copy a texture repeats that.
    """
    first = sum(texture.shape[0] * texture.shape[1] for texture in textures)
    starts = np.cumsum([0, *(texture.shape[0] * texture.shape[1] for texture in textures)])
    levels = np.zeros((len(textures), MOST_LEVELS, 3), np.int32)
    copies: list[Bytes] = []
    for number, texture in enumerate(textures):
        levels[number] = starts[number], texture.shape[1], texture.shape[0]
        for level in range(1, MOST_LEVELS) if number in wanted else ():
            if texture.shape[:2] == (1, 1):
                break
            texture = halved(texture)
            levels[number, level:] = first, texture.shape[1], texture.shape[0]
            first += texture.shape[0] * texture.shape[1]
            copies.append(texture)
    return copies, levels


def halved(texture: Bytes) -> Bytes:
    """A texture (height, width, 4) with half as many texels along each side, at least 1."""
    means = np.concatenate([linear_from_srgb8(texture[..., :3]), texture[..., 3:].astype(np.float32)], axis=2)
    means = _half(_half(means).swapaxes(0, 1)).swapaxes(0, 1)
    return np.concatenate([srgb8_from_linear(means[..., :3]), np.rint(means[..., 3:]).astype(np.uint8)], axis=2)


def _half(values: Float32) -> Float32:
    """Means of n // 2 equal parts of the n rows, at least one."""
    n = len(values)
    m = n // 2
    if n == 1:
        return values
    if n == 2 * m:
        return np.asarray((values[0::2] + values[1::2]) * np.float32(0.5))
    # part k has three rows of texels, 2 k to 2 k + 2; the first and the last lie in it partly
    edges = np.arange(m + 1) * (n / m)
    found = np.empty((m, *values.shape[1:]), np.float32)
    rows_at_once = max(_AT_ONCE // values[0].size, 1)
    for begin in range(0, m, rows_at_once):
        k = np.arange(begin, min(begin + rows_at_once, m))
        rows = 2 * k[:, None] + np.arange(3)
        weights = np.minimum(rows + 1, edges[k + 1, None]) - np.maximum(rows, edges[k, None])
        weights /= weights.sum(axis=1, keepdims=True)
        found[k] = (weights[:, None, :] @ values[rows].reshape(len(k), 3, -1)).reshape(found[k].shape)
    return found


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneReport:
    """Contents of a scene file, as reported to the user.

    Attributes:
        dropped: reason -> number of triangles left out, e.g. "degenerate", "non-finite", "duplicate", "transmissive".
        notes: what was not understood or was approximated, one sentence each.
        lights: number of light sources in the file; a job has its own.
        normal_maps: number of normal maps in use.
    """

    triangles: int
    materials: int
    textures: int
    dropped: dict[str, int] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    lights: int = 0
    normal_maps: int = 0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scene:
    """One merged triangle mesh with materials; a feature the scene lacks is an array of length 0.

    Opaque triangles come first; those from `n_opaque` on have an alpha mask.

    Attributes:
        centre: (3,) float64; scene coordinates = file coordinates - centre.
        corners: (n, 3, 3) corner positions, centred.
        normals: (n, 3, 3) unit shading normals per corner, or (0, 3, 3) where no mesh has them.
        uvs: (k n, 3, 2) texture coordinates, v upwards: k sets, one after another; (0, 3, 2) where nothing is textured.
        colours: (n, 3, 3) linear corner colours that multiply the reflectivity, or (0, 3, 3).
        material: (n,) index into the material tables.
        material_names: m names.
        object: (n,) index of each triangle's object among `object_names`, as in the file.
        object_names: each once.
        reflectivity: (m, 3) diffuse reflectivity, before texture and corner colour.
        specular: (m, 3) mirror reflectivity, before texture and corner colour.
        reflectivity_texture: (m,) texture that multiplies `reflectivity`, or -1.
        specular_texture: (m,) texture that multiplies `specular`, or -1.
        emission: (m, 3) radiance that surfaces emit, before texture; as the file gives it.
        emission_texture: (m,) texture that multiplies `emission`, or -1.
        one_sided: (m,) True if only the front of surfaces is seen and emits, by the file.
        roughness, metallic: (m,) of glossy materials, whose `reflectivity` is then the base colour, before texture;
            roughness is 0 of all others. (0,) where none is glossy.
        coat, coat_roughness: (m,) weight and roughness of clear coats; (0,) likewise.
        gloss_texture: (m,) texture whose green multiplies `roughness`, blue `metallic`, red `coat` and alpha
            `coat_roughness`, or -1; (0,) likewise.
        alpha: (m,) opacity factor, multiplied with the alpha of `alpha_texture`.
        alpha_texture: (m,) texture whose alpha is the mask, or -1.
        alpha_cutoff: (m,) a point of a masked triangle is absent where alpha < cutoff; below 0, see `SCREENED`.
        texels: (n_texels, 4) uint8 RGBA of all textures one after another; colours sRGB encoded, alpha linear;
            row 0 on top.
        textures: (n_textures, 3) int32 first texel, width, height.
        samplers: (n_textures,) continuation, blending and set of texture coordinates of each, see `model.WRAP_V`; (0,)
            where all repeat, blend and have the first set.
        levels: (n_textures, MOST_LEVELS, 3) first texel, width and height of smaller copies of textures (`add_mips`),
            whose texels follow the textures'; or (0, MOST_LEVELS, 3).
        n_opaque: number of triangles without alpha mask.
        tangents: (n, 3, 4) per corner: the unit vector in which u of the normal map grows, or 0, and w, which with
            normal x tangent gives the bitangent; (0, 3, 4) where no material has a normal map.
        normal_uvs: (n, 3, 2) texture coordinates of normal maps, v upwards, or (0, 3, 2).
        normal_texture: (m,) normal map, or -1.
        normal_scale: (m,) what multiplies red and green of the normal map.
        pane_corners: (p, 3, 3) corner positions of the triangles of thin glass, centred; they are no part of `corners`.
        pane_optics: (p, PANE_COLUMNS) what each of them lets through; see `panes.py`.
        pane_uvs, pane_texture: (p, 3, 2) texture coordinates, v upwards, and (p,) texture that multiplies the colour,
            or -1; no rows where no pane has a texture.
        pane_material, pane_object: (p,) as `material` and `object`.
    """

    centre: Float64
    corners: Corners
    normals: Corners
    uvs: CornerUvs
    colours: Corners
    material: Int32
    material_names: tuple[str, ...]
    object: Int32
    object_names: tuple[str, ...]
    reflectivity: Rgb
    specular: Rgb
    reflectivity_texture: Int32
    specular_texture: Int32
    emission: Rgb
    emission_texture: Int32
    one_sided: Bytes
    roughness: Float32
    metallic: Float32
    coat: Float32
    coat_roughness: Float32
    gloss_texture: Int32
    alpha: Float32
    alpha_texture: Int32
    alpha_cutoff: Float32
    texels: Bytes
    textures: Int32
    samplers: Int32
    levels: Int32
    n_opaque: int
    tangents: Float32
    normal_uvs: CornerUvs
    normal_texture: Int32
    normal_scale: Float32
    pane_corners: Corners
    pane_optics: Float32
    pane_uvs: CornerUvs
    pane_texture: Int32
    pane_material: Int32
    pane_object: Int32
    report: SceneReport

    @property
    def has_glass(self) -> bool:
        """True if any triangle is thin glass."""
        return len(self.pane_corners) > 0

    @property
    def position_origin(self) -> Float64:
        """(3,) point that positions in layers are relative to, in file coordinates.

        It is 0, but in scenes so far away that float32 would move positions by more than a hundred-thousandth of their
        size, as after a survey; there it is their rounded centre, which float32 holds exactly.
        """
        size = max(float(np.ptp(box_of(self.corners), axis=0).max()), float(np.finfo(np.float32).tiny))
        unit = 10.0 ** np.ceil(np.log10(size))
        rounded: Float64 = np.rint(self.centre / unit) * unit
        return np.where(np.abs(self.centre).max() > FAR * size, rounded.astype(np.float32), 0.0).astype(np.float64)

    @property
    def is_glossy(self) -> bool:
        """True if any triangle is glossy."""
        return bool(len(self.roughness) and (self.roughness[np.unique(self.material)] > 0).any())

    @property
    def has_mirrors(self) -> bool:
        """True if any triangle reflects specularly; without one the specular code never runs."""
        return bool((self.specular[np.unique(self.material)] > 0).any())


def load_scene(
    file: Path,
    overrides: Mapping[str, MaterialTable] | None = None,
    folders: Sequence[Path] = (),
    memory: int | None = None,
    shining: Container[str] = (),
    *,
    as_file: bool = False,
    all_uvs: bool = False,
    time: float | None = None,
    hide_backs: bool = False,
) -> Scene:
    """Read a scene file, clean it and move it to its own centre.

    Args:
        file: any format that trimesh reads.
        overrides: by material name; a value replaces factor, texture and corner colours of that part.
        folders: where files that the scene names may lie, besides its own folder.
        memory: bytes that reading may allocate; None: all free memory.
        shining: names of the materials whose emission is read; other emission is 0.
        as_file: True if surfaces follow the file, with its normal maps, glass and smaller copies of textures; else
            they are diffuse or mirrors.
        all_uvs: True if texture coordinates are kept where no texture needs them, too.
        time: of the pose of what moves, seconds; None: the start of the file's range.
        hide_backs: True if each of two one-sided surfaces in one place stays, as each hides the other's back.

    Raises:
        SceneError: a file that cannot be read, holds nothing to render, or lacks an overridden material.
    """
    meshes = read_meshes(file, folders, memory, shining, as_file=as_file, all_uvs=all_uvs, time=time)
    try:
        return build_scene(meshes, overrides or {}, as_file=as_file, all_uvs=all_uvs, hide_backs=hide_backs)
    except SceneError as error:
        raise SceneError(f"{file}: {error}") from error
    except MemoryError as error:
        raise SceneError(f"{file}: does not fit into memory") from error


def build_scene(
    meshes: Meshes, overrides: Mapping[str, MaterialTable], *, as_file: bool = False, all_uvs: bool = False,
    hide_backs: bool = False,
) -> Scene:  # fmt: skip
    """Make the arrays that kernels read from the contents of a file."""
    meshes, notes = with_something_shown(meshes), Notes()
    parts, materials = add_untextured_variants(meshes.parts, meshes.materials, meshes.samplers, notes)
    materials = override_materials(materials, overrides, meshes.textures, notes)
    plain = {name for name, override in overrides.items() if override.reflectivity is not None}
    parts = [replace(p, colours=None) if materials[p.material].name in plain else p for p in parts]
    merged, dropped = merge(parts), dict(meshes.dropped)
    keep, centre, corners = select_triangles(merged, materials, dropped, meshes.notes, notes, hide_backs=hide_backs)
    panes = select_panes(merged, materials, meshes.samplers, centre, dropped, notes)
    material = merged.material[keep]
    normals, uvs, tangents, normal_uvs = _empty(3), _empty(2), _empty(4), _empty(2)
    if merged.tangents is not None and merged.normal_uvs is not None:
        tangents, normal_uvs = rows_of(merged.tangents, keep), wrap_uvs(rows_of(merged.normal_uvs, keep), notes)
    if merged.normals is not None and (merged.has_normals[keep].any() or len(tangents)):
        normals = unit_normals(rows_of(merged.normals, keep), merged.has_normals[keep], corners, notes)
    if merged.uvs is not None and (all_uvs or any(m.textured for m in materials)):
        uvs = _uv_sets(rows_of(merged.uvs, keep), material, materials, meshes.samplers, notes)
    colours = _empty(3) if merged.colours is None else merged.colours[keep]
    tables = _material_tables(materials)
    texels, textures, levels = _texture_tables(meshes.textures, materials if as_file else ())
    return Scene(
        centre=centre,
        corners=corners,
        normals=normals,
        uvs=uvs,
        colours=colours,
        material=material,
        material_names=tuple(m.name for m in materials),
        object=merged.object[keep],
        object_names=merged.objects,
        **tables,
        n_opaque=int((tables["alpha_cutoff"][material] == 0).sum()),
        texels=texels,
        textures=textures,
        samplers=np.array(meshes.samplers if any(meshes.samplers) else (), np.int32),
        levels=levels,
        tangents=tangents,
        normal_uvs=normal_uvs,
        pane_corners=panes.corners,
        pane_optics=panes.optics,
        pane_uvs=panes.uvs,
        pane_texture=panes.texture,
        pane_material=merged.material[panes.rows],
        pane_object=merged.object[panes.rows],
        report=SceneReport(
            triangles=int((~is_glass(merged, materials)[keep]).sum()),
            materials=len(np.unique(material)),
            textures=len(different(meshes.textures)),
            dropped=dropped,
            notes=meshes.notes + notes.lines(),
            lights=meshes.lights,
            normal_maps=len({materials[m].normal_texture for m in np.unique(material)} - {-1}),
        ),
    )


# Types of the values that `Scene` has of each material, as `Material` names them.
_TABLES: Mapping[str, Any] = {
    **dict.fromkeys(("reflectivity", "specular", "emission", "alpha", "alpha_cutoff", "normal_scale"), np.float32),
    **dict.fromkeys(("specular_texture", "emission_texture", "alpha_texture", "normal_texture"), np.int32),
    "one_sided": np.uint8,
}
_GLOSS_TABLES: Mapping[str, Any] = {
    **dict.fromkeys(("roughness", "metallic", "coat", "coat_roughness"), np.float32),
    "gloss_texture": np.int32,
}


def _material_tables(materials: Sequence[Material]) -> dict[str, Any]:
    """Make the arrays with a value per material; the arrays of gloss have length 0 if no material is glossy."""
    glossy = materials if any(m.roughness > 0 for m in materials) else []
    tables = {name: np.array([getattr(m, name) for m in materials], dtype) for name, dtype in _TABLES.items()}
    tables |= {name: np.array([getattr(m, name) for m in glossy], dtype) for name, dtype in _GLOSS_TABLES.items()}
    return tables | {"reflectivity_texture": np.array([m.texture for m in materials], np.int32)}


def _texture_tables(images: Sequence[Bytes], shown: Sequence[Material]) -> tuple[Bytes, Int32, Int32]:
    """`Scene.texels`, `Scene.textures` and `Scene.levels`; textures of shown materials get smaller copies."""
    once = different(images)
    numbers = {id(image): number for number, image in enumerate(once)}
    of_image = np.array([numbers[id(image)] for image in images], np.int64)
    wanted = {number for m in shown for number in (m.texture, m.specular_texture)} - {-1}
    copies, levels = add_mips(once, {int(of_image[number]) for number in wanted})
    levels, texels = levels[of_image], [image.reshape(-1, 4) for image in (*once, *copies)]
    joined = np.concatenate(texels) if texels else np.zeros((0, 4), dtype=np.uint8)
    return joined, levels[:, 0].copy(), levels if wanted else levels[:0]


def _uv_sets(
    uvs: Float64, material: Int32, materials: Sequence[Material], samplers: Sequence[int], notes: Notes
) -> CornerUvs:
    """`Scene.uvs` of (n, 3, 2 k) texture coordinates, n triangles of materials."""
    found = []
    for k in range(uvs.shape[2] // 2):
        fixed = [
            any(samplers and samplers[t] & WRAPS and uv_set(samplers, t) == k for t in m.used_textures)
            for m in materials
        ]
        found.append(wrap_uvs(uvs[..., 2 * k : 2 * k + 2], notes, np.array(fixed)[material] if any(fixed) else None))
    return np.concatenate(found)


def _empty(width: int) -> Float32:
    return np.zeros((0, 3, width), dtype=np.float32)


def scene_report_lines(report: SceneReport, file: Path | str) -> list[str]:
    """The report on a scene: one line of numbers, then one line per note."""
    left_out = f"; left out: {dropped_text(report.dropped)}" if report.dropped else ""
    found = (report.triangles, "triangle"), (report.materials, "material"), (report.textures, "texture")
    numbers = ", ".join(counted(n, noun) for n, noun in found)
    if report.normal_maps:
        numbers += f", {counted(report.normal_maps, 'normal map')} in use"
    return [f"{file}: {numbers}{left_out}", *(f"note: {note}" for note in report.notes)]
