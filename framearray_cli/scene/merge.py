"""Parts -> one array each of corners, normals, texture coordinates, colours and materials.

Of all triangles the ones that can be traced are selected: finite, with an area, and not repeated.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Corners, CornerUvs, Flags, Float32, Float64
from framearray_cli.base.errors import SceneError
from framearray_cli.base.units import agree, counted

from .files.model import UV_SET, Material, Notes, Part
from .vectors import are_finite, cross, hash_rows, largest, lengths, mix, rows_of

FAR_UV = 16.0  # float32 texture coordinates beyond it lose texels: whole repeats are subtracted
MOST_UV = 1e30  # beyond it one texel is as good as another: differences stay within float32


def add_untextured_variants(
    parts: Sequence[Part], materials: Sequence[Material], samplers: Sequence[int], notes: Notes
) -> tuple[list[Part], list[Material]]:
    """Give each part that lacks texture coordinates a variant of its material without their textures."""
    variants: dict[tuple[int, frozenset[int]], int] = {}
    new_parts, new_materials = [], list(materials)
    for part in parts:
        material, lacks = materials[part.material], _lacking(part.uvs)
        lost = frozenset(t for t in material.used_textures if part.uvs is None or uv_set(samplers, t) in lacks)
        if lost:
            notes.add("meshes without texture coordinates show no texture", material.name)
            number = variants.setdefault((part.material, lost), len(new_materials))
            if number == len(new_materials):
                new_materials.append(material.without(lost))
            part = replace(part, material=number)
        if lacks and part.uvs is not None:
            part = replace(part, uvs=np.nan_to_num(part.uvs, nan=0.0))
        new_parts.append(part)
    return new_parts, new_materials


def uv_set(samplers: Sequence[int], texture: int) -> int:
    """Number of the set of texture coordinates of a texture."""
    return samplers[texture] >> UV_SET if samplers else 0


def _lacking(uvs: Float64 | None) -> set[int]:
    """The sets of texture coordinates that a part has no numbers for, of several."""
    if uvs is None or uvs.shape[2] == 2:
        return set()
    return {k // 2 for k in range(0, uvs.shape[2], 2) if np.isnan(uvs[..., k]).all()}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Merged:
    """All triangles of all parts. Optional data is None if no part has it; if some have, the others get defaults.

    Attributes:
        corners: (n, 3, 3) in file coordinates.
        normals: (n, 3, 3); NaN for parts without. There are some where there are tangents.
        has_normals: (n,) True if the file gives normals.
        uvs: (n, 3, 2 k), k sets; 0 for parts without.
        colours: (n, 3, 3); white for parts without.
        tangents: (n, 3, 4) with unit vectors; 0 for parts without, and where there is none.
        normal_uvs: (n, 3, 2); 0 for parts without.
        material: (n,).
        object: (n,) index among `objects`, the names of all objects, each once.
    """

    corners: Float64
    normals: Corners | None
    has_normals: Flags
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
    ends = np.cumsum(counts)

    def joined(name: str, width: int, missing: float, dtype: Any, convert: Callable[[Any], Any] | None = None) -> Any:
        """(n, 3, width) values of all parts, `missing` where a part has none; None if no part has some."""
        if all(getattr(part, name) is None for part in parts):
            return None
        found = np.full((sum(counts), 3, width), missing, dtype)
        for part, end, count in zip(parts, ends, counts, strict=True):
            if (values := getattr(part, name)) is not None:
                found[end - count : end, :, : values.shape[2]] = values if convert is None else convert(values)
        return found

    tangents = joined("tangents", 4, 0.0, np.float32, _unit_tangents)
    normals = joined("normals", 3, np.nan, np.float32, _scale_normals)
    if normals is None and tangents is not None:
        normals = np.full((sum(counts), 3, 3), np.nan, np.float32)
    numbers: dict[str, int] = {}
    number = [np.array([numbers.setdefault(name, len(numbers)) for name in part.objects], np.int32) for part in parts]
    objects = [
        np.full(count, of[0], np.int32) if part.object is None else of[part.object]
        for part, of, count in zip(parts, number, counts, strict=True)
    ]
    return Merged(
        corners=np.concatenate([part.corners for part in parts]),
        normals=normals,
        has_normals=np.repeat([part.normals is not None for part in parts], counts),
        uvs=joined("uvs", max(0 if part.uvs is None else part.uvs.shape[2] for part in parts), 0.0, np.float64),
        colours=joined("colours", 3, 1.0, np.float32),
        tangents=tangents,
        normal_uvs=joined("normal_uvs", 2, 0.0, np.float64),
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


def unit_normals(normals: Corners, has_normals: Flags, corners: Corners, notes: Notes) -> Corners:
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


def wrap_uvs(uvs: Float64, notes: Notes, kept: Flags | None = None) -> CornerUvs:
    """Convert texture coordinates to float32; move far ones back by whole repeats, as textures repeat.

    Args:
        kept: (n,) True if the texture of a triangle does not repeat.
    """
    bad = ~are_finite(uvs)
    if bad.any():
        notes.add(f"{int(bad.sum())} texture coordinates are missing or not numbers, taken as 0")
        uvs = np.where(bad[..., None], 0.0, uvs)
    with np.errstate(over="ignore"):  # far ones are replaced
        wrapped = uvs.astype(np.float32)
    beyond = largest(uvs.reshape(-1, 6)) > FAR_UV
    far = np.flatnonzero(beyond if kept is None else beyond & ~kept)
    held = np.clip(uvs[far], -MOST_UV, MOST_UV)
    wrapped[far] = held - np.floor(held.min(axis=1, keepdims=True))
    return wrapped


# A triangle lower than this share of its longest side is narrower than float32 resolves its corners: its normal would
# be noise.
SLIVER = 2.0**-23


def has_area(corners: Float64 | Corners) -> Flags:
    """(n,) True if a triangle is more than a line, at any scale of the scene.

    Args:
        corners: (n, 3, 3) finite positions.
    """
    # float64 holds differences and products of float32 coordinates exactly, so flat means flat
    with np.errstate(all="ignore"):  # a triangle beyond the range of float64 compares false, and is left out
        first = corners[:, 1].astype(np.float64) - corners[:, 0]
        second = corners[:, 2].astype(np.float64) - corners[:, 0]
        longest = np.maximum(largest(first), largest(second))
        scale = 1.0 / np.where(longest > 0, longest, 1.0)
        area = cross(first * scale[:, None], second * scale[:, None])
    return np.asarray((longest > 0) & (largest(area) > SLIVER))


def first_alike(corners: Corners, group: NDArray[np.integer]) -> NDArray[np.int64]:
    """(n,) the first triangle of the same group with the same three corners, in any order: mostly itself.

    Args:
        corners: (n, 3, 3) positions.
        group: (n,) only triangles of the same group are compared.
    """
    hashes = hash_rows(corners)  # (n, 3)
    keys = hashes[:, 0] + hashes[:, 1] + hashes[:, 2] + mix(group.astype(np.uint64))
    ordered = np.sort(keys)
    if not (ordered[1:] == ordered[:-1]).any():  # as in most scenes
        return np.arange(len(keys))
    _, first, same = np.unique(keys, return_index=True, return_inverse=True)
    return np.asarray(first[same], np.int64)


def _turned(corners: Corners) -> NDArray[np.int64]:
    """(n,) 0 or 1: which way triangles wind; of two with the same corners the same if both face the same way."""
    a, b, c = hash_rows(corners).T
    return np.asarray((a > b) ^ (b > c) ^ (a > c), np.int64)


# Between these sizes tracing was measured to be right. Far below, float32 is denormal; far above, rays hit nothing.
SMALLEST_SCENE, LARGEST_SCENE = 1e-12, 1e12


def select_triangles(
    merged: Merged, materials: Sequence[Material], dropped: dict[str, int], notes: Sequence[str], found: Notes,
    *, hide_backs: bool = False,
) -> tuple[NDArray[np.int64], Float64, Corners]:  # fmt: skip
    """Select the triangles that stay, and centre them.

    Args:
        merged: all triangles of the file.
        materials: indexed by `merged.material`.
        dropped: gets the reasons and numbers of triangles left out.
        notes: repeated in the error when nothing stays.
        found: gets the names of materials that others cover.
        hide_backs: True if each of two one-sided triangles in one place that face away from each other stays.

    Returns:
        Rows of `merged` that stay, opaque ones first; the centre (3,); their corners (n, 3, 3), centred. Where all are
        thin glass, one stands for surfaces: the diagonal of their bounds, without an area, which no ray meets.

    Raises:
        SceneError: nothing stays, or a size that cannot be traced.
    """
    rows = np.flatnonzero(~is_glass(merged, materials))
    if not len(rows):
        return _stand_in(merged)
    rows = drop(rows, ~are_finite(rows_of(merged.corners, rows).reshape(-1, 9)), "non-finite", dropped)
    for reason in sorted({material.left_out for material in materials} - {""}):
        absent = np.array([material.left_out == reason for material in materials])
        rows = drop(rows, absent[merged.material[rows]], reason, dropped)
    rows = drop(rows, ~has_area(rows_of(merged.corners, rows)), "degenerate", dropped)
    _check_left(rows, dropped, notes)
    left = rows_of(merged.corners, rows)
    # axis by axis: numpy takes ten times as long for the bounds of all three at once
    low, high = (np.array([bound(left[..., axis]) for axis in range(3)]) for bound in (np.min, np.max))
    centre = low / 2 + high / 2
    size = float((high / 2 - low / 2).max()) * 2
    if not SMALLEST_SCENE <= size <= LARGEST_SCENE:
        raise SceneError(
            f"the scene is {size:.3g} units wide; expected {SMALLEST_SCENE:g} to {LARGEST_SCENE:g}; scale the model"
        )
    corners = (left - centre).astype(np.float32)
    flat = ~has_area(corners)
    rows, corners = drop(rows, flat, "degenerate", dropped), rows_of(corners, np.flatnonzero(~flat))
    cutoff = np.array([material.alpha_cutoff for material in materials])
    masked = cutoff[merged.material[rows]] != 0
    order = np.argsort(masked, kind="stable")
    rows, corners, masked = rows[order], rows_of(corners, order), masked[order]
    # of coinciding opaque triangles one hides the others, of any material; a cut-out one lets others show
    material, n = merged.material[rows], len(materials)
    group = np.where(masked, material + 1, 0)
    if hide_backs and (one_sided := np.array([m.one_sided for m in materials])[material] & ~masked).any():
        group[one_sided] = n + 1 + _turned(corners[one_sided])
    first = first_alike(corners, group)
    again = first != np.arange(len(first))
    for lost in np.unique(material[again & (material[first] != material)]) if again.any() else ():
        found.add("other surfaces are in the same place, some are left out", materials[lost].name)
    rows, corners = drop(rows, again, "duplicate", dropped), rows_of(corners, np.flatnonzero(~again))
    _check_left(rows, dropped, notes)
    return rows, centre, corners


def _stand_in(merged: Merged) -> tuple[NDArray[np.int64], Float64, Corners]:
    """`select_triangles` of thin glass alone."""
    points = merged.corners[are_finite(merged.corners.reshape(-1, 9))].reshape(-1, 3)
    if not len(points):
        raise SceneError("no triangle is left to render: all of them are non-finite")
    low, high = points.min(axis=0), points.max(axis=0)
    half = (high / 2 - low / 2).astype(np.float32)
    return np.zeros(1, np.int64), low / 2 + high / 2, np.stack([-half, half, -half])[None]


def is_glass(merged: Merged, materials: Sequence[Material]) -> Flags:
    """(n,) True if each triangle of all parts is thin glass."""
    glass = np.array([material.glass is not None for material in materials], np.bool_)
    return np.asarray(glass[merged.material])


def drop(rows: NDArray[np.int64], bad: Flags, reason: str, dropped: dict[str, int]) -> NDArray[np.int64]:
    """Leave out bad rows, and count them under the reason."""
    count = int(bad.sum())
    if count:
        dropped[reason] = dropped.get(reason, 0) + count
    return rows[~bad] if count else rows


def _check_left(rows: NDArray[np.int64], dropped: Mapping[str, int], notes: Sequence[str]) -> None:
    if len(rows) == 0:
        found = "; ".join((dropped_text(dropped), *notes))
        raise SceneError(f"no triangle is left to render: {found}")


def dropped_text(dropped: Mapping[str, int]) -> str:
    """The numbers of triangles left out, with the reasons."""
    return ", ".join(f"{count} {reason}" for reason, count in dropped.items())
