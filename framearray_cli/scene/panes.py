"""Thin glass: the triangles that light passes straight through, and the share of it that each lets pass.

Of light that meets a face at the angle theta, the share F = f + g (1 - cos(theta))^5 is reflected, with
f = ((ior - 1) / (ior + 1))^2 and g = 1 - f (Schlick). A sheet without thickness stands for a pane with two faces,
between which light is reflected to and fro: it passes colour (1 - F) / (1 + F) and reflects 2 F / (1 + F). Of a body
with a thickness, which is a mesh that closes, each face passes the root of the colour times 1 - F, and reflects F. A
solid body also bends the rays of eyes; all other light passes it straight.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Corners, CornerUvs, Flags, Float32, Float64, Int32
from framearray_cli.base.units import counted

from .files import Material, Notes
from .files.model import WRAPS
from .merge import Merged, drop, first_alike, geometric_normals, has_area, is_glass, uv_set, wrap_uvs
from .vectors import are_finite, largest

# Columns of a triangle: colour, RGB; f and g of its reflectance; 1 of a sheet and 0 of a body; unit normal; the height
# at which rays leave it, see `Surfaces.offset`; the refractive index of a solid body, 0 of all others.
COLOUR, F, G, SHEET, NORMAL, OFFSET, BENDS = 0, 3, 4, 5, 6, 9, 10
PANE_COLUMNS = 11
OFFSET_SHARE = 16.0 * 2.0**-23  # of the largest coordinate, as of other triangles


@dataclass(frozen=True, slots=True, eq=False)
class Panes:
    """The triangles of thin glass, as `Scene` has them, and their rows among all of the file."""

    corners: Corners
    optics: Float32
    uvs: CornerUvs
    texture: Int32
    rows: NDArray[np.int64]


def select_panes(
    merged: Merged, materials: Sequence[Material], samplers: Sequence[int], centre: Float64, dropped: dict[str, int],
    notes: Notes,
) -> Panes:  # fmt: skip
    """Select the triangles of thin glass; of coinciding ones the first counts.

    Args:
        merged: all triangles of the file.
        materials: indexed by `merged.material`.
        samplers: of the textures.
        centre: (3,) of the scene.
        dropped: gets the reasons and numbers of triangles left out.
        notes: gets the number of triangles.
    """
    rows = np.flatnonzero(is_glass(merged, materials))
    rows = drop(rows, ~are_finite(merged.corners[rows].reshape(-1, 9)), "non-finite", dropped)
    corners = (merged.corners[rows] - centre).astype(np.float32)
    flat = ~has_area(corners)
    rows, corners = drop(rows, flat, "degenerate", dropped), corners[~flat]
    again = first_alike(corners, np.zeros(len(rows), np.int64)) != np.arange(len(rows))
    rows, corners = drop(rows, again, "duplicate", dropped), corners[~again]
    optics, material = np.zeros((len(corners), PANE_COLUMNS), np.float32), merged.material[rows]
    uvs, texture = np.zeros((len(rows), 3, 2)), np.full(len(rows), -1, np.int32)
    fixed = np.zeros(len(rows), np.bool_)
    if not len(rows):
        return Panes(corners, optics, uvs.astype(np.float32), texture, rows)
    closed = in_closed_mesh(corners)
    for number in np.unique(material):
        glass = materials[number].glass
        assert glass is not None
        some = material == number
        colour = np.array(glass.colour)
        optics[some, COLOUR : COLOUR + 3] = colour
        if glass.texture >= 0 and merged.uvs is not None:
            first, texture[some] = 2 * uv_set(samplers, glass.texture), glass.texture
            uvs[some] = merged.uvs[rows[some], :, first : first + 2]
            fixed[some] = bool(samplers) and samplers[glass.texture] & WRAPS > 0
        if not glass.covers:
            optics[some & closed, COLOUR : COLOUR + 3] = np.sqrt(colour)
            optics[some & closed, BENDS] = glass.ior if glass.solid and glass.ior > 1 else 0
            optics[some, F] = ((glass.ior - 1) / (glass.ior + 1)) ** 2
            optics[some, G] = 1 - optics[some, F]
    optics[:, SHEET] = ~closed
    optics[:, NORMAL : NORMAL + 3] = geometric_normals(corners)
    optics[:, OFFSET] = OFFSET_SHARE * largest(corners.reshape(-1, 9))
    sheets = int((optics[:, SHEET] > 0).sum())
    solid = int((optics[:, BENDS] > 0).sum())
    hollow = len(optics) - sheets - solid
    parts = [f"{counted(sheets, 'triangle')} of sheets"] * (sheets > 0)
    parts += [f"{counted(hollow, 'triangle')} of closed bodies, which do not refract"] * (hollow > 0)
    parts += [f"{counted(solid, 'triangle')} of solid bodies, whose shadows are straight"] * (solid > 0)
    notes.add(f"glass: {' and '.join(parts)}")
    textured = texture[: len(texture) * bool((texture >= 0).any())]  # none if no pane has any
    return Panes(corners, optics, wrap_uvs(uvs[: len(textured)], notes, fixed[: len(textured)]), textured, rows)


def in_closed_mesh(corners: Corners) -> Flags:
    """(n,) True if a triangle belongs to a mesh of triangles, joined at their corners, each edge of which has two.

    Args:
        corners: (n, 3, 3) positions; corners at the same place are one vertex.
    """
    _, vertex = np.unique(corners.reshape(-1, 3) + np.float32(0.0), axis=0, return_inverse=True)
    faces = vertex.reshape(-1, 3)
    n = int(faces.max()) + 1
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2), axis=2)  # (n, 3, 2)
    _, number, count = np.unique(edges[..., 0] * n + edges[..., 1], return_inverse=True, return_counts=True)
    whole = (count[number.reshape(-1, 3)] == 2).all(axis=1)
    # the lowest vertex of the mesh that each vertex belongs to
    label = np.arange(n)
    while True:
        lowest = label[faces].min(axis=1)
        new = label.copy()
        np.minimum.at(new, faces.reshape(-1), np.repeat(lowest, 3))
        new = new[new]
        if (new == label).all():
            break
        label = new
    open_mesh = np.zeros(n, np.bool_)
    open_mesh[label[faces[~whole, 0]]] = True
    return np.asarray(~open_mesh[label[faces[:, 0]]])
