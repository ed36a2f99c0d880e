"""Parts -> one array each of corners, normals, texture coordinates, colours and materials."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Corners, CornerUvs, Float32, Float64
from framearray_cli.base.units import agree, counted

from .files.model import Material, Notes, Part
from .vectors import are_finite, cross, largest, lengths

FAR_UV = 16.0  # float32 texture coordinates beyond it lose texels: whole repeats are subtracted
MOST_UV = 1e30  # beyond it one texel is as good as another: differences stay within float32


def add_untextured_variants(
    parts: Sequence[Part], materials: Sequence[Material], notes: Notes
) -> tuple[list[Part], list[Material]]:
    """Give each part without texture coordinates a variant of its material without textures."""
    variants: dict[int, int] = {}
    new_parts, new_materials = [], list(materials)
    for part in parts:
        material = materials[part.material]
        textured = material.textured
        if part.uvs is None and textured:
            notes.add("meshes without texture coordinates show no texture", material.name)
            if part.material not in variants:
                variants[part.material] = len(new_materials)
                new_materials.append(material.without_textures())
            part = replace(part, material=variants[part.material])
        new_parts.append(part)
    return new_parts, new_materials


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Merged:
    """All triangles of all parts. Optional data is None if no part has it; if some have, the others get defaults.

    Attributes:
        corners: (n, 3, 3) in file coordinates.
        normals: (n, 3, 3); NaN for parts without. There are some where there are tangents.
        has_normals: (n,) True if the file gives normals.
        uvs: (n, 3, 2).
        colours: (n, 3, 3); white for parts without.
        tangents: (n, 3, 4) with unit vectors; 0 for parts without, and where there is none.
        normal_uvs: (n, 3, 2); 0 for parts without.
        material: (n,).
        object: (n,) index among `objects`, the names of all objects, each once.
    """

    corners: Float64
    normals: Corners | None
    has_normals: NDArray[np.bool_]
    uvs: Float64 | None
    colours: Corners | None
    tangents: Float32 | None
    normal_uvs: Float64 | None
    material: NDArray[np.int32]
    object: NDArray[np.int32]
    objects: tuple[str, ...]


def merge(parts: Sequence[Part]) -> Merged:
    """Join the parts, in order."""
    counts = [len(part.corners) for part in parts]
    n = sum(counts)
    ends = np.cumsum(counts)
    bumpy = any(p.tangents is not None for p in parts)
    normal = bumpy or any(p.normals is not None for p in parts)
    normals = np.full((n, 3, 3), np.nan, dtype=np.float32) if normal else None
    uvs = np.zeros((n, 3, 2)) if any(p.uvs is not None for p in parts) else None
    colours = np.ones((n, 3, 3), dtype=np.float32) if any(p.colours is not None for p in parts) else None
    tangents = np.zeros((n, 3, 4), dtype=np.float32) if bumpy else None
    normal_uvs = np.zeros((n, 3, 2)) if bumpy else None
    has_normals = np.zeros(n, dtype=np.bool_)
    for part, end, count in zip(parts, ends, counts, strict=True):
        rows = slice(end - count, end)
        if normals is not None and part.normals is not None:
            normals[rows] = _scale_normals(part.normals)
            has_normals[rows] = True
        if uvs is not None and part.uvs is not None:
            uvs[rows] = part.uvs
        if colours is not None and part.colours is not None:
            colours[rows] = part.colours
        if tangents is not None and part.tangents is not None:
            tangents[rows] = _unit_tangents(part.tangents)
        if normal_uvs is not None and part.normal_uvs is not None:
            normal_uvs[rows] = part.normal_uvs
    numbers: dict[str, int] = {}
    number = [np.array([numbers.setdefault(name, len(numbers)) for name in part.objects], np.int32) for part in parts]
    objects = [
        np.full(count, of[0], np.int32) if part.object is None else of[part.object]
        for part, of, count in zip(parts, number, counts, strict=True)
    ]
    return Merged(
        corners=np.concatenate([part.corners for part in parts]),
        normals=normals,
        has_normals=has_normals,
        uvs=uvs,
        colours=colours,
        tangents=tangents,
        normal_uvs=normal_uvs,
        material=np.repeat(np.array([part.material for part in parts], dtype=np.int32), counts),
        object=np.concatenate(objects),
        objects=tuple(numbers),
    )


def _scale_normals(normals: Float64) -> Float64:
    """Scale normals so that their largest component is 1: float32 would round normals of a tiny node to 0."""
    with np.errstate(all="ignore"):
        return np.asarray(normals / largest(normals)[..., None])


def _unit_tangents(tangents: Float64) -> Float64:
    """Tangents with vectors of length 1; 0 where there is no direction."""
    with np.errstate(all="ignore"):
        scaled = tangents[..., :3] / largest(tangents[..., :3])[..., None]
        unit = scaled / lengths(scaled)[..., None]
    known = are_finite(unit)[..., None]
    return np.concatenate([np.where(known, unit, 0.0), tangents[..., 3:] * known], axis=2)


def unit_normals(normals: Corners, has_normals: NDArray[np.bool_], corners: Corners, notes: Notes) -> Corners:
    """Compute unit shading normals; geometric ones replace those that are missing, zero or not numbers.

    Args:
        normals: (n, 3, 3) of any length.
        has_normals: (n,) True if the file gives normals for a triangle.
        corners: (n, 3, 3) positions of triangles with an area.
        notes: gets the number of broken normals.
    """
    with np.errstate(all="ignore"):
        unit = normals / lengths(normals)[..., None]
    bad = ~are_finite(unit)  # (n, 3)
    if not bad.any():
        return np.asarray(unit, dtype=np.float32)
    broken = int((bad & has_normals[:, None]).sum())
    if broken:
        notes.add(
            f"{counted(broken, 'corner normal')} {agree(broken, 'is', 'are')} zero, missing or no number; "
            "geometric normals stand in"
        )
    rows = np.flatnonzero(bad.any(axis=1))
    unit[bad] = np.repeat(geometric_normals(corners[rows])[:, None], 3, axis=1)[bad[rows]]
    return np.asarray(unit, dtype=np.float32)


def geometric_normals(corners: Corners) -> Corners:
    """(n, 3) unit normals by winding, for triangles with an area."""
    first = corners[:, 1].astype(np.float64) - corners[:, 0]
    second = corners[:, 2].astype(np.float64) - corners[:, 0]
    normal = cross(first / largest(first)[:, None], second / largest(second)[:, None])
    return np.asarray(normal / lengths(normal)[:, None], dtype=np.float32)


def wrap_uvs(uvs: Float64, notes: Notes) -> CornerUvs:
    """Convert texture coordinates to float32; move far ones back by whole repeats, as textures repeat."""
    bad = ~are_finite(uvs)
    if bad.any():
        notes.add(f"{int(bad.sum())} texture coordinates are missing or not numbers, taken as 0")
        uvs = np.where(bad[..., None], 0.0, uvs)
    with np.errstate(over="ignore"):  # far ones are replaced
        wrapped = uvs.astype(np.float32)
    far = np.flatnonzero(largest(uvs.reshape(len(uvs), -1)) > FAR_UV)
    held = np.clip(uvs[far], -MOST_UV, MOST_UV)
    wrapped[far] = held - np.floor(held.min(axis=1, keepdims=True))
    return wrapped
