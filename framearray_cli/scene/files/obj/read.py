"""OBJ text -> parts.

trimesh is not used: it takes relative indices from the end of the file, skips "v<TAB>x", reads only the first
material library, splits concave polygons into fans, and drops colours and normals that only some lines have.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Float32, Float64
from framearray_cli.base.units import agree, counted

from ..assets import AssetError, Assets
from ..materials import clean_colours, default_material
from ..model import Material, Meshes, Notes, Part
from ..tangents import with_tangents
from ..textures import TextureTable
from .mtl import MapUse, MtlEntry, parse_mtl, to_material
from .polygons import Ears, triangulate

Indices = NDArray[np.int64]

UNNAMED, PLAIN = "default", MapUse(file="")  # the object of faces before any name; texture coordinates as they are
MOST_LIBRARIES = 1000  # a scene has one or two; each costs an access to the disk


@dataclass(slots=True)
class ObjText:
    """The lines of an OBJ file by keyword; one entry per line."""

    v: list[str] = field(default_factory=list)
    vt: list[str] = field(default_factory=list)
    vn: list[str] = field(default_factory=list)
    faces: list[str] = field(default_factory=list)
    seen: list[tuple[int, int, int]] = field(default_factory=list)  # the numbers of v, vt, vn lines above a face
    face_material: list[int] = field(default_factory=list)  # index in `materials`, or -1
    face_object: list[int] = field(default_factory=list)  # index in `objects`
    materials: list[str] = field(default_factory=list)  # names after usemtl
    objects: list[str] = field(default_factory=list)  # names after o, or g where no line says o
    libraries: list[str] = field(default_factory=list)
    others: set[str] = field(default_factory=set)  # keywords that hold points, lines or curved surfaces


def read_obj(data: bytes, assets: Assets) -> Meshes:
    """Read an OBJ file and its material libraries.

    Raises:
        ValueError: a line holds something other than numbers.
        SceneError: an image is too large to read.
    """
    notes = Notes()
    text = split_lines(decode_text(data))
    for keyword in sorted(text.others):
        notes.add(f"'{keyword}' lines (points, lines or curved surfaces) are left out")
    if text.v and not text.faces:
        notes.add("points without faces are left out")
    positions, colours = _vertices(text.v, notes)
    uvs, normals = _columns(text.vt, 2, "vt"), _columns(text.vn, 3, "vn")
    corners, face = _triangles(text, positions, notes)  # (n, 3, 3) indices v, vt, vn, and (n,) face line
    inside = ((corners[..., 0] >= 0) & (corners[..., 0] < len(positions))).all(axis=1)
    dropped = {"index out of range": int((~inside).sum())} if not inside.all() else {}
    corners, face = corners[inside], face[inside]
    object_of = np.array(text.face_object, dtype=np.int32)[face] if len(face) else np.zeros(0, dtype=np.int32)
    material_of = np.array(text.face_material, dtype=np.int64)[face] if len(face) else np.zeros(0, dtype=np.int64)

    textures = TextureTable(notes, assets.limit)
    library = _libraries(text.libraries, assets, notes)
    materials: list[Material] = []
    parts: list[Part] = []
    for place in np.unique(material_of):
        rows = corners[material_of == place]
        material, use, relief = _material(text, int(place), colours is not None, library, assets, textures, notes)
        part = Part(
            material=len(materials),
            corners=positions[rows[..., 0]],
            normals=_pick(normals, rows[..., 2]),
            uvs=_placed(uvs, rows[..., 1], use or (PLAIN if assets.all_uvs else None)),
            colours=None if colours is None else colours[rows[..., 0]],
            normal_uvs=_placed(uvs, rows[..., 1], relief),
            objects=tuple(text.objects),
            object=object_of[material_of == place],
        )
        parts.append(with_tangents(part, assets.limit))
        materials.append(material)
    return Meshes(
        parts=tuple(parts),
        materials=tuple(materials),
        textures=tuple(textures.textures),
        dropped=dropped,
        notes=notes.lines(),
    )


def decode_text(data: bytes) -> str:
    """Decode text in UTF-8, UTF-16 (recognised by its mark or its zero bytes) or Latin-1."""
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data.decode("utf-16")
    head = data[:64]
    if head[1::2].count(0) > len(head) // 4:
        return data.decode("utf-16-le")
    if head[::2].count(0) > len(head) // 4:
        return data.decode("utf-16-be")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def split_lines(text: str) -> ObjText:
    """Group the lines of an OBJ file by keyword; a backslash joins a line with the next."""
    out = ObjText()
    places: dict[str, int] = {}
    material, current, groups = -1, "", ""
    named: list[tuple[str, str]] = []  # of each face: names after o and g
    tables = {"v": out.v, "vt": out.vt, "vn": out.vn}
    for line in re.sub(r"\\\r?\n", " ", text).splitlines():
        words = line.split(None, 1)
        if len(words) < 2 or words[0][0] == "#":
            continue
        key, rest = words
        if key in tables:
            tables[key].append(rest if "#" not in rest else rest.split("#", 1)[0])
        elif key == "f":
            out.faces.append(rest if "#" not in rest else rest.split("#", 1)[0])
            out.seen.append((len(out.v), len(out.vt), len(out.vn)))
            out.face_material.append(material)
            named.append((current, groups))
        elif key == "usemtl":
            name = rest.strip()
            material = places.setdefault(name, len(places))
        elif key == "o":
            current = rest.strip()
        elif key == "g":
            groups = rest.strip()
        elif key == "mtllib":
            out.libraries.append(rest.strip())
        elif key in {"p", "l", "curv", "curv2", "surf"}:
            out.others.add(key)
    out.materials = list(places)
    _number_objects(out, named)
    return out


def _number_objects(out: ObjText, named: Sequence[tuple[str, str]]) -> None:
    """Number the objects of all faces: by lines o, or by lines g in a file without."""
    by_object = any(name for name, _ in named)
    numbers: dict[str, int] = {}
    for name, group in named:
        out.face_object.append(numbers.setdefault((name if by_object else group) or UNNAMED, len(numbers)))
    out.objects = list(numbers) or [UNNAMED]


def _columns(lines: Sequence[str], n: int, keyword: str) -> Float64:
    """Parse lines to (lines, n) numbers; fill shorter lines with 0, cut longer ones."""
    rows = [line.split() for line in lines]
    widths = np.array([len(row) for row in rows], dtype=np.int64)
    out = np.zeros((len(rows), n))
    for width in np.unique(widths):
        at = np.flatnonzero(widths == width)
        some = rows if len(at) == len(rows) else [rows[i] for i in at]
        keep = min(int(width), n)
        try:
            out[at, :keep] = np.array(some, dtype=np.float64)[:, :keep]
        except ValueError:
            out[at, :keep] = np.array([[_number(word, keyword) for word in row] for row in some])[:, :keep]
    return out


def _number(word: str, keyword: str) -> float:
    """Parse a number, even with the sign of its exponent in the wrong place: 3.1-e2 is 3.1e-2."""
    try:
        return float(re.sub(r"([+-])[eE](\d)", r"e\1\2", word))
    except ValueError as error:
        raise ValueError(f"'{keyword}' line: expected a number, got '{word}'") from error


def _vertices(lines: Sequence[str], notes: Notes) -> tuple[Float64, Float32 | None]:
    """Parse (n, 3) positions, and (n, 3) colours if any vertex has one; the others are white."""
    table = _columns(lines, 6, "v")
    widths = np.array([len(line.split()) for line in lines], dtype=np.int64)
    if len(widths) and widths.min() < 3:
        raise ValueError(f"'v' line: expected 3 numbers, got {int(widths.min())}")
    coloured = widths >= 6
    if not coloured.any():
        return table[:, :3].copy(), None
    colours = table[:, 3:]
    if not coloured.all():
        notes.add("vertices without a colour beside coloured ones are white")
        colours[~coloured] = 1.0
    return table[:, :3].copy(), clean_colours(colours, notes)


def _triangles(text: ObjText, positions: Float64, notes: Notes) -> tuple[Indices, Indices]:
    """Triangulate every face.

    Returns:
        (n, 3, 3) zero-based v, vt, vn indices per corner (-1: none), and (n,) the face line, both in file order.
    """
    rows = [line.split() for line in text.faces]
    sizes = np.array([len(row) for row in rows], dtype=np.int64)
    if (sizes < 3).any():
        n = int((sizes < 3).sum())
        notes.add(f"{counted(n, 'face')} with fewer than 3 corners {agree(n, 'is', 'are')} left out")
    fill = {0: "/0/0", 1: "/0", 2: ""}
    try:
        tokens = [word.rstrip("/").replace("//", "/0/") for row in rows for word in row]
        flat = np.array([(word + fill[word.count("/")]).split("/") for word in tokens], dtype=np.int64)
    except (ValueError, KeyError) as error:
        raise ValueError(f"'f' line: expected indices like 1, 1/2, 1//3 or 1/2/3 ({error})") from error
    flat = flat.reshape(-1, 3)
    seen = np.repeat(np.array(text.seen, dtype=np.int64).reshape(-1, 3), sizes, axis=0)
    flat = np.where(flat < 0, np.maximum(flat + seen, -1), flat - 1)  # relative indices count back from the face
    starts, ears = np.cumsum(sizes) - sizes, Ears()
    triangles, faces = [np.zeros((0, 3, 3), dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    for size in np.unique(sizes[sizes >= 3]):
        at = np.flatnonzero(sizes == size)
        corners = flat[starts[at][:, None] + np.arange(size)]  # (m, size, 3)
        place = np.clip(corners[..., 0], 0, max(len(positions) - 1, 0))
        local = triangulate(positions[place], ears) if len(positions) else np.zeros((0, 0, 3), dtype=np.int64)
        m, t = local.shape[:2]
        triangles.append(corners[np.arange(m)[:, None, None], local].reshape(m * t, 3, 3))
        faces.append(np.repeat(at[:m], t))
    if ears.fans:
        notes.add(f"{ears.fans} concave polygons of very many corners are split as if they were convex")
    face = np.concatenate(faces)
    order = np.argsort(face, kind="stable")
    return np.concatenate(triangles)[order], face[order]


def _pick(table: Float64, index: Indices) -> Float64 | None:
    """Pick rows of a table by (n, 3) index: NaN for a missing index, None if all are missing."""
    known = (index >= 0) & (index < len(table))
    if not known.any():
        return None
    picked = table[np.where(known, index, 0)]
    picked[~known] = np.nan
    return picked


def _placed(table: Float64, index: Indices, use: MapUse | None) -> Float64 | None:
    """Pick the texture coordinates of a map; None without a map, or if all are missing."""
    picked = None if use is None else _pick(table, index)
    return None if picked is None or use is None else picked * np.array(use.scale) + np.array(use.offset)


def _libraries(names: Sequence[str], assets: Assets, notes: Notes) -> dict[str, MtlEntry]:
    """Read the materials of all `mtllib` lines; the first of each name counts."""
    entries: dict[str, MtlEntry] = {}
    different = list(dict.fromkeys(names))
    if len(different) > MOST_LIBRARIES:
        raise ValueError(f"expected at most {MOST_LIBRARIES} material libraries, got {len(different)}")
    for name in different:
        plain = name.split("#", 1)[0].strip()
        for data in _first_readable(([name], [plain], plain.split()), assets, notes):
            for key, entry in parse_mtl(decode_text(data)).items():
                entries.setdefault(key, entry)
    return entries


def _first_readable(readings: Sequence[list[str]], assets: Assets, notes: Notes) -> list[bytes]:
    """Read the files of the first reading of a line (one name with spaces, or several names) of which all exist."""
    reason: AssetError | None = None
    before = len(assets.refused)
    for names in readings:
        try:
            found = [assets.read(name) for name in names]
            del assets.refused[before:]  # other readings of the line added these
            return found
        except AssetError as error:
            reason = reason or error
    notes.add(f"material library left out, {reason}")
    return []


def _material(
    text: ObjText,
    place: int,
    coloured: bool,
    library: dict[str, MtlEntry],
    assets: Assets,
    textures: TextureTable,
    notes: Notes,
) -> tuple[Material, MapUse | None, MapUse | None]:
    """The material, with the uses of its maps, at an index of the `usemtl` names, or a default for faces without."""
    name = text.materials[place] if place >= 0 else ""
    entry = library.get(name) or library.get(name.split("#", 1)[0].strip())
    if entry is not None:
        return to_material(entry, assets, textures, notes)
    if name:
        notes.add("materials not found in any material library", name)
    return default_material(coloured, notes, name), None, None
