"""OBJ and MTL text -> parts and materials.

trimesh is not used: it takes relative indices from the end of the file, skips "v<TAB>x", reads only the first
material library, splits concave polygons into fans, drops colours and normals that only some lines have, and ignores
map options, Windows paths, `d` and `illum`.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from framearray_cli.base.arrays import Float32, Float64
from framearray_cli.base.units import agree, counted

from .assets import AssetError, Assets
from .geometry import Indices, join_sets, tangents_within, triangulate_faces
from .materials import (
    BLACK,
    IN_PLACE,
    ROUGH_METAL,
    MaterialSource,
    MeshBuilder,
    PlacedMaterial,
    Split,
    SurfaceGloss,
    TexturePlaces,
    clean_colours,
    default_material,
    is_mirror,
)
from .model import GREY, Material, Meshes, Notes, PaneGlass, Part, Rgb3, rgb3
from .textures import UDIM, EncodedImage

MIRROR_MODELS = (3, 5)  # illum: ray traced reflection, without and with Fresnel
GLASS_MODELS = (4, 6, 7, 9)
IOR = 1.5  # of glass without Ni
# The lowest Ns of a mirror. Exporters write Ns = 1000 (1 - roughness)^2, and a mirror's roughness is at most 0.1.
MIRROR_NS, SHARPEST_NS = 810.0, 1000.0
NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?"
# An option of a map with its values; the name of the file follows all of them.
MAP_OPTION = re.compile(
    rf"(?:-(?:type|imfchan)\s+\S+|-[a-z]+\s+(?:on|off)|-[a-z]+(?:\s+{NUMBER}(?=\s)){{1,3}})\s+", re.IGNORECASE
)
STRENGTH = re.compile(rf"-bm\s+({NUMBER})\s", re.IGNORECASE)
IGNORED_MAPS = [f"map_{what}" for what in ("ks", "ns", "ke", "ka", "refl", "pr", "pm", "ps", "tr")] + ["disp", "refl"]
RELIEF = ("norm", "map_bump", "bump")  # normal and height maps; the first that a material has counts


Values = Mapping[str, str]  # the lines of a `newmtl` block: lower-case key -> the rest of the line


def parse_mtl(text: str) -> dict[str, Values]:
    """Split the text of a material library into its materials; the first of each name counts."""
    entries: dict[str, Values] = {}
    entry: dict[str, str] | None = None
    for line in text.splitlines():
        words = line.strip().split(None, 1)
        if len(words) < 2 or words[0].startswith("#"):
            continue
        key, value = words[0].lower(), words[1].strip()
        if key == "newmtl":
            entries.setdefault(value, entry := {})
        elif entry is not None:
            entry[key] = value if key.startswith("map") else value.split("#", 1)[0].strip()
    return entries


@dataclass(frozen=True, slots=True, kw_only=True)
class ObjMaterial(MaterialSource):
    """A material of a material library, and the lines of its block."""

    values: Values

    def read(self) -> PlacedMaterial:
        """Map the material to a diffuse part, a mirror part and an opacity."""
        file = _map_file(self.values.get("map_kd"))
        image = self._image(file) if file else None
        texture = self.placed(self.textures.index(image), _places(image))
        kd, ks = self._base_colour(bool(file)), self._rgb("ks")
        surface: SurfaceGloss | Split = (kd, BLACK)
        shine = self._gloss(kd, ks) if self.assets.as_file else None
        if shine is not None and is_mirror(shine.metallic, shine.roughness):
            surface = self.split_metal(np.array(shine.base), shine.metallic, shine.roughness)
        elif shine is not None:
            surface = shine
        elif self._model in MIRROR_MODELS and ks is not None and max(ks) > 0:
            if self._number("ns", 1000.0) >= MIRROR_NS:
                surface = (kd, ks)
            else:
                surface = (rgb3(np.add(kd, ks)), BLACK)
                self.note(ROUGH_METAL)
        opacity = self._opacity(texture)
        self._note_ignored()
        material = self.make(opacity, surface, texture=texture)
        if self.shows_emission and (ke := self._rgb("ke")) is not None:
            material = replace(material, emission=rgb3(np.maximum(ke, 0.0)))
        return self._with_relief(material)

    @property
    def _model(self) -> int:
        return int(self._number("illum", 2))

    def _rgb(self, key: str) -> Rgb3 | None:
        """Three numbers, or one for all three; None if the key is missing or holds something else."""
        numbers = _floats(self.values.get(key, "").split()[:3])
        return rgb3(numbers if len(numbers) == 3 else numbers[:1] * 3) if numbers else None

    def _number(self, key: str, default: float) -> float:
        """The last word as a number (in `d -halo 0.5` an option comes first)."""
        numbers = _floats(self.values.get(key, "").split()[-1:])
        return numbers[0] if numbers and abs(numbers[0]) < float("inf") else default

    def _image(self, file: str) -> EncodedImage:
        if UDIM in file:
            return self.tiled(("file", file), lambda number: self.assets.read(file.replace(UDIM, str(number))))
        return self.image(("file", file), partial(self.assets.read, file))

    def _with_relief(self, material: Material) -> PlacedMaterial:
        """Give the material its normal map, if surfaces follow the file."""
        value = next((self.values[key] for key in RELIEF if key in self.values), "")
        if not value or not self.assets.as_file:
            return PlacedMaterial(material=material, places=self.places)
        image = self._image(_map_file(value))
        texture, heights = self.textures.relief(image)
        if texture >= 0 and heights:
            self.note("height maps are taken as normals, with heights in texels")
        strength = STRENGTH.search(value)
        material = replace(material, normal_texture=texture, normal_scale=float(strength[1]) if strength else 1.0)
        return PlacedMaterial(material=material, places=self.places, normal_places=_places(image))

    def _gloss(self, kd: Rgb3, ks: Rgb3 | None) -> SurfaceGloss | None:
        """Gloss of the material, by Pr and Pm, or by Ns if it has a Ks; None without gloss.

        Ks says no more than that: exporters write 0.5 for the 4 % of what is no metal.
        """
        ns = min(max(self._number("ns", 0.0), 0.0), SHARPEST_NS)
        roughness = self._number("pr", 1.0 - (ns / SHARPEST_NS) ** 0.5)
        if "pr" in self.values or "pm" in self.values:
            return SurfaceGloss(base=kd, roughness=roughness, metallic=self._number("pm", 0.0))
        if ks is None or max(ks) <= 0 or self._model < 2:
            return None
        if self._model in MIRROR_MODELS:
            if ns >= MIRROR_NS or "ns" not in self.values:
                return None
            return SurfaceGloss(base=rgb3(np.add(kd, ks)), roughness=roughness, metallic=1.0)
        return SurfaceGloss(base=kd, roughness=roughness, metallic=0.0)

    def _base_colour(self, textured: bool) -> Rgb3:
        """Kd; white under a texture if Kd is missing or black: exporters then mean only the texture."""
        kd = self._rgb("kd")
        if "kd" in self.values and kd is None:
            self.note("Kd is not three numbers, taken as grey")
        if textured and kd == BLACK:
            self.note("black Kd under a texture is taken as white")
        if textured and kd in (None, BLACK):
            return (1.0, 1.0, 1.0)
        return (GREY, GREY, GREY) if kd is None else kd

    def _opacity(self, texture: int) -> Material:
        transparency = self._number("tr", 0.0)
        if "d" not in self.values and transparency == 1.0:
            self.note("Tr 1 without d is taken as opaque: many exporters mean that")
            transparency = 0.0
        file = _map_file(self.values.get("map_d"))
        alpha = self.shown_alpha(self._number("d", 1.0 - transparency), bool(file) or "map_kd" in self.values)
        if file:
            image = self._image(file)
            texture = self.placed(self.textures.cutout(image), _places(image))
        opacity = self.blended(alpha, texture, self._pane(alpha) if self.assets.as_file else None)
        clear = opacity.left_out or opacity.glass or opacity.alpha_cutoff < 0
        if not clear and self._model in GLASS_MODELS:
            self.note("glass that is not nearly clear (d from 0.25) is taken as opaque")
        return opacity

    def _pane(self, alpha: float) -> PaneGlass:
        """The pane of a nearly clear material: coloured by Tf, and of glass if `illum` or Ni says so."""
        tf = self._rgb("tf") or (1.0, 1.0, 1.0)
        colour = rgb3([min(max(channel * (1.0 - alpha), 0.0), 1.0) for channel in tf])
        glass = self._model in GLASS_MODELS or self._number("ni", 1.0) > 1.0
        return PaneGlass(colour=colour, ior=max(self._number("ni", IOR), 1.0) if glass else 1.0, covers=not glass)

    def _note_ignored(self) -> None:
        ke, values = self._rgb("ke"), self.values
        self.note_unused(emits=ke is not None and max(ke) > 0)
        for key in IGNORED_MAPS:
            if key in values:
                self.note(f"{key} maps are left out")
        self.note_unused(bumps=any(key in values for key in RELIEF))
        if ("pm" in values or "pr" in values) and not self.assets.as_file:
            self.note('Pm and Pr (metalness and roughness) are left out; scene.surfaces = "file" uses them')
        options = {option.split()[0] for value in values.values() for option in MAP_OPTION.findall(value)}
        if left := sorted(options - {"-bm"}):
            self.note(f"options of maps ({', '.join(left)}) are left out")


def _places(image: EncodedImage | None) -> TexturePlaces:
    """Places of an image, which may be in tiles."""
    return TexturePlaces(matrix=IN_PLACE / np.reshape(image.counts, (2, 1)) if image and image.tiles else None)


def _map_file(value: str | None) -> str:
    """The file name in `[-option values ...] file name`, which may hold spaces; "" without a map."""
    rest = (value or "").strip()
    while option := MAP_OPTION.match(rest):
        rest = rest[option.end() :]
    return rest


def _floats(words: Sequence[str]) -> list[float]:
    """Words as numbers; none if any is something else."""
    try:
        return [float(word) for word in words]
    except ValueError:
        return []


UNNAMED = "default"  # the object of faces before any name
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
    found = MeshBuilder(assets=assets)
    notes, text = found.notes, split_lines(decode_text(data))
    for keyword in sorted(text.others):
        notes.add(f"'{keyword}' lines (points, lines or curved surfaces) are left out")
    if text.v and not text.faces:
        notes.add("points without faces are left out")
    positions, colours = _vertices(text.v, notes)
    uvs, normals = _columns(text.vt, 2, "vt"), _columns(text.vn, 3, "vn")
    corners, face = _triangles(text, positions, notes)  # (n, 3, 3) indices v, vt, vn, and (n,) face line
    inside = ((corners[..., 0] >= 0) & (corners[..., 0] < len(positions))).all(axis=1)
    found.outside = int((~inside).sum())
    corners, face = corners[inside], face[inside]
    object_of = np.array(text.face_object, dtype=np.int32)[face]
    material_of = np.array(text.face_material, dtype=np.int64)[face]
    library = _libraries(text.libraries, assets, notes)
    for place in np.unique(material_of):
        rows = corners[material_of == place]
        name = text.materials[place] if place >= 0 else ""
        known = next((known for known in (name, name.split("#", 1)[0].strip()) if known in library), None)
        if known is not None:
            values = library[known]
            material = ObjMaterial(name=known, assets=assets, textures=found.textures, values=values).read()
        else:
            if name:
                notes.add("materials not found in any material library", name)
            material = PlacedMaterial(material=default_material(colours is not None, notes, name))
        shown, bumps = material.material.textured or assets.all_uvs, material.material.normal_texture >= 0
        part = Part(
            material=found.add_material(material),
            corners=positions[rows[..., 0]],
            normals=_pick(normals, rows[..., 2]),
            uvs=_uvs(uvs, rows[..., 1], material.places) if shown else None,
            colours=None if colours is None else colours[rows[..., 0]],
            normal_uvs=_uvs(uvs, rows[..., 1], [material.normal_places]) if bumps else None,
            objects=tuple(text.objects),
            object=object_of[material_of == place],
        )
        if part.normal_uvs is not None:
            tangents = tangents_within(assets.limit, part.corners, part.normals, part.normal_uvs)
            part = replace(part, tangents=tangents)
        found.parts.append(part)
    return found.meshes()


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
    by_object = any(name for name, _ in named)  # by lines o, or by lines g in a file without
    numbers: dict[str, int] = {}
    for name, group in named:
        out.face_object.append(numbers.setdefault((name if by_object else group) or UNNAMED, len(numbers)))
    out.objects = list(numbers) or [UNNAMED]
    return out


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
            out[at, :keep] = np.array([[_parsed(word, keyword) for word in row] for row in some])[:, :keep]
    return out


def _parsed(word: str, keyword: str) -> float:
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
        notes.add("vertices without a colour among coloured ones are white")
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
    places = np.clip(flat[:, 0], 0, max(len(positions) - 1, 0))
    points = positions[places] if len(positions) else np.zeros((len(flat), 3))
    triangles, faces = triangulate_faces(points, sizes, (sizes >= 3) & (len(positions) > 0), notes)
    return flat[triangles], faces


def _pick(table: Float64, index: Indices) -> Float64 | None:
    """Pick rows of a table by index: NaN for a missing index, None if all are missing."""
    known = (index >= 0) & (index < len(table))
    if not known.any():
        return None
    picked = table[np.where(known, index, 0)]
    picked[~known] = np.nan
    return picked


def _uvs(table: Float64, index: Indices, places: Sequence[TexturePlaces]) -> Float64 | None:
    """(n, 3, 2 k) texture coordinates for images at k places, one without any."""
    uvs = _pick(table, index.reshape(-1))
    sets = None if uvs is None else join_sets([one.of(uvs) for one in places or [TexturePlaces()]])
    return None if sets is None else sets.reshape(*index.shape, -1)


def _libraries(names: Sequence[str], assets: Assets, notes: Notes) -> dict[str, Values]:
    """Read the materials of all `mtllib` lines; the first of each name counts."""
    entries: dict[str, Values] = {}
    different = list(dict.fromkeys(names))
    if len(different) > MOST_LIBRARIES:
        raise ValueError(f"expected at most {MOST_LIBRARIES} material libraries, got {len(different)}")
    for name in different:
        plain = name.split("#", 1)[0].strip()
        reasons, before = list[AssetError](), set(assets.refused)
        for reading in ([name], [plain], plain.split()):  # one name with spaces, or several names; all must exist
            try:
                found = [assets.read(file) for file in reading]
            except AssetError as error:
                reasons.append(error)
                continue
            for file in assets.refused.keys() - before:  # other readings of the line added these
                del assets.refused[file]
            for key, entry in [item for data in found for item in parse_mtl(decode_text(data)).items()]:
                entries.setdefault(key, entry)
            break
        else:
            notes.add(f"material library left out, {reasons[0]}")
    return entries
