"""MTL text -> materials. trimesh is not used: it ignores map options, Windows paths, `d` and `illum`."""

import math
import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from ..assets import Assets
from ..gloss import Gloss, is_mirror, with_gloss
from ..materials import NO_NORMAL_MAPS, ONLY_SEEN, Opacity, Rgb3, blended_opacity, make_material, shown_alpha
from ..model import GREY, Glass, Material, Notes
from ..textures import TextureTable

MIRROR_MODELS = (3, 5)  # illum: ray traced reflection, without and with Fresnel
GLASS_MODELS = (4, 6, 7, 9)
IOR = 1.5  # of glass without Ni
# The lowest Ns of a mirror. Exporters write Ns = 1000 (1 - roughness)^2, and a mirror's roughness is at most 0.1.
MIRROR_NS, SHARPEST_NS = 810.0, 1000.0
MAP_OPTIONS = {"-blendu": 1, "-blendv": 1, "-boost": 1, "-mm": 2, "-texres": 1, "-clamp": 1, "-bm": 1, "-imfchan": 1}
MAP_OPTIONS |= {"-type": 1, "-cc": 1, "-o": 3, "-s": 3, "-t": 3}
IGNORED_MAPS = [f"map_{what}" for what in ("ks", "ns", "ke", "ka", "refl", "pr", "pm", "ps", "tr")] + ["disp", "refl"]
RELIEF = ("norm", "map_bump", "bump")  # normal and height maps; the first that a material has counts


@dataclass(frozen=True, slots=True, kw_only=True)
class MapUse:
    """A texture of a material: its file, and uv' = scale * uv + offset; `strength` multiplies heights (-bm)."""

    file: str
    scale: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)
    clamp: bool = False
    strength: float = 1.0


@dataclass(slots=True)
class MtlEntry:
    """The lines of a `newmtl` block: lower-case key -> the rest of the line."""

    name: str
    values: dict[str, str] = field(default_factory=dict)


def parse_mtl(text: str) -> dict[str, MtlEntry]:
    """Split the text of a material library into its materials; the first of each name counts."""
    entries: dict[str, MtlEntry] = {}
    entry: MtlEntry | None = None
    for line in text.splitlines():
        words = line.strip().split(None, 1)
        if len(words) < 2 or words[0].startswith("#"):
            continue
        key, value = words[0].lower(), words[1].strip()
        if key == "newmtl":
            entry = MtlEntry(value)
            entries.setdefault(value, entry)
        elif entry is not None:
            entry.values[key] = value if key.startswith("map") else value.split("#", 1)[0].strip()
    return entries


def to_material(
    entry: MtlEntry, assets: Assets, textures: TextureTable, notes: Notes
) -> tuple[Material, MapUse | None, MapUse | None]:
    """Map an MTL material to a diffuse part, a mirror part and an opacity.

    Returns:
        The material, and the uses of its base texture and of its normal map, whose scales and offsets the reader
        applies.
    """
    name, values = entry.name, entry.values
    use = _map_use(values.get("map_kd"))
    texture = -1
    if use is not None:
        file = use.file
        texture = textures.index(("file", file), f"material {name}", lambda: assets.read(file))
    kd, ks = _base_colour(name, values, use is not None, notes), _rgb(values, "ks")
    specular: Rgb3 = (0.0, 0.0, 0.0)
    shine = _gloss(values, kd, ks) if assets.as_file else None
    if shine is not None and is_mirror(shine.metallic, shine.roughness):
        metal, kd, shine = shine.metallic, shine.base, None
        kd, specular = _scaled(kd, 1.0 - metal), _scaled(kd, metal)
    elif shine is not None:
        kd = shine.base
    elif int(_number(values, "illum", 2)) in MIRROR_MODELS and ks is not None and max(ks) > 0:
        if _number(values, "ns", 1000.0) >= MIRROR_NS:
            specular = ks
        else:
            kd = (kd[0] + ks[0], kd[1] + ks[1], kd[2] + ks[2])
            notes.add("rough metals are taken as diffuse", name)
    opacity = _opacity(name, values, texture, assets, textures, notes)
    shines = name in assets.shining or assets.as_file
    _note_ignored(name, values, use, assets, notes)
    material = make_material(name, kd, specular, opacity, notes, texture=texture)
    material = with_gloss(material, shine)
    if shines and (ke := _rgb(values, "ke")) is not None:
        material = replace(material, emission=(max(ke[0], 0.0), max(ke[1], 0.0), max(ke[2], 0.0)))
    material, relief = _relief(material, values, assets, textures, notes)
    return material, use if texture >= 0 else None, relief


def _relief(
    material: Material, values: Mapping[str, str], assets: Assets, textures: TextureTable, notes: Notes
) -> tuple[Material, MapUse | None]:
    """Give a material its normal map, if surfaces follow the file; also return how the map is used."""
    use = next((_map_use(values[key]) for key in RELIEF if key in values), None)
    if use is None or not assets.as_file:
        return material, None
    file = use.file
    texture, heights = textures.relief(("file", file), f"material {material.name}", lambda: assets.read(file))
    if texture < 0:
        return material, None
    if heights:
        notes.add("height maps are taken as normals, with heights in texels", material.name)
    return replace(material, normal_texture=texture, normal_scale=use.strength), use


def _gloss(values: Mapping[str, str], kd: Rgb3, ks: Rgb3 | None) -> Gloss | None:
    """How a material shines, by Pr and Pm, or by Ns where it has a Ks; None where it does not.

    Ks says no more than that: exporters write 0.5 for the 4 % of what is no metal.
    """
    ns = min(max(_number(values, "ns", 0.0), 0.0), SHARPEST_NS)
    roughness = _number(values, "pr", 1.0 - (ns / SHARPEST_NS) ** 0.5)
    if "pr" in values or "pm" in values:
        return Gloss(base=kd, roughness=roughness, metallic=_number(values, "pm", 0.0))
    model = int(_number(values, "illum", 2))
    if ks is None or max(ks) <= 0 or model < 2:
        return None
    if model in MIRROR_MODELS:
        if ns >= MIRROR_NS or "ns" not in values:
            return None
        return Gloss(base=(kd[0] + ks[0], kd[1] + ks[1], kd[2] + ks[2]), roughness=roughness, metallic=1.0)
    return Gloss(base=kd, roughness=roughness, metallic=0.0)


def _scaled(colour: Rgb3, factor: float) -> Rgb3:
    return (factor * colour[0], factor * colour[1], factor * colour[2])


def _base_colour(name: str, values: Mapping[str, str], textured: bool, notes: Notes) -> Rgb3:
    """Kd; white under a texture if Kd is missing or black: exporters then mean only the texture."""
    kd = _rgb(values, "kd")
    if "kd" in values and kd is None:
        notes.add("Kd is not three numbers, taken as grey", name)
    if textured and kd == (0.0, 0.0, 0.0):
        notes.add("black Kd under a texture is taken as white", name)
    if textured and (kd is None or kd == (0.0, 0.0, 0.0)):
        return (1.0, 1.0, 1.0)
    return (GREY, GREY, GREY) if kd is None else kd


def _opacity(
    name: str, values: Mapping[str, str], texture: int, assets: Assets, textures: TextureTable, notes: Notes
) -> Opacity:
    transparency = _number(values, "tr", 0.0)
    if "d" not in values and transparency == 1.0:
        notes.add("Tr 1 without d is taken as opaque: many exporters mean that", name)
        transparency = 0.0
    alpha = _number(values, "d", 1.0 - transparency)
    use = _map_use(values.get("map_d"))
    alpha = shown_alpha(name, alpha, use is not None or "map_kd" in values, notes)
    if use is not None:
        file = use.file
        texture = textures.cutout(("file", file), f"material {name}", lambda: assets.read(file))
    pane = _pane(values, alpha) if assets.as_file else None
    opacity = blended_opacity(name, alpha, texture, textures, notes, pane)
    clear = opacity.left_out or opacity.glass or opacity.alpha_cutoff < 0
    if not clear and int(_number(values, "illum", 2)) in GLASS_MODELS:
        notes.add("glass that is not nearly clear (d from 0.25) is taken as opaque", name)
    return opacity


def _pane(values: Mapping[str, str], alpha: float) -> Glass:
    """The pane of a nearly clear material: coloured by Tf, and of glass if `illum` or Ni says so."""
    tf = _rgb(values, "tf") or (1.0, 1.0, 1.0)
    red, green, blue = (min(max(channel * (1.0 - alpha), 0.0), 1.0) for channel in tf)
    glass = int(_number(values, "illum", 2)) in GLASS_MODELS or _number(values, "ni", 1.0) > 1.0
    return Glass(
        colour=(red, green, blue), ior=max(_number(values, "ni", IOR), 1.0) if glass else 1.0, covers=not glass
    )


def _note_ignored(name: str, values: Mapping[str, str], use: MapUse | None, assets: Assets, notes: Notes) -> None:
    ke = _rgb(values, "ke")
    if name not in assets.shining and ke is not None and max(ke) > 0:
        notes.add(ONLY_SEEN if assets.as_file else "emission is left out", name)
    for key in IGNORED_MAPS:
        if key in values:
            notes.add(f"{key} maps are left out", name)
    if not assets.as_file and any(key in values for key in RELIEF):
        notes.add(NO_NORMAL_MAPS, name)
    if ("pm" in values or "pr" in values) and not assets.as_file:
        notes.add('Pm and Pr (metalness and roughness) are left out; scene.surfaces = "file" uses them', name)
    if use is not None and use.clamp:
        notes.add("textures that clamp at their edges repeat", name)


def _map_use(value: str | None) -> MapUse | None:
    """Parse `[-option values ...] file name`, where the name may hold spaces."""
    if value is None:
        return None
    words = shlex.split(value, posix=False) if '"' in value else value.split()
    found: dict[str, list[str]] = {}
    at = 0
    while at < len(words) - 1 and words[at].lower() in MAP_OPTIONS:
        option = words[at].lower()
        last = min(at + 1 + MAP_OPTIONS[option], len(words) - 1)
        end = at + 1
        while end < last and (option not in ("-o", "-s", "-t") or _is_number(words[end])):
            end += 1
        found[option] = words[at + 1 : end]
        at = end
    scale = [float(word) for word in found.get("-s", [])] + [1.0, 1.0]
    offset = [float(word) for word in found.get("-o", [])] + [0.0, 0.0]
    if len(found.get("-s", [])) == 1:
        scale[1] = 1.0
    file = value.strip() if at == 0 else " ".join(words[at:])
    clamp = found.get("-clamp", [""])[:1] == ["on"]
    strength = [float(word) for word in found.get("-bm", []) if _is_number(word) and math.isfinite(float(word))]
    return MapUse(
        file=file,
        scale=(scale[0], scale[1]),
        offset=(offset[0], offset[1]),
        clamp=clamp,
        strength=strength[0] if strength else 1.0,
    )


def _rgb(values: Mapping[str, str], key: str) -> Rgb3 | None:
    """Three numbers, or one for all three; None if the key is missing or holds something else."""
    words = values.get(key, "").split()
    if not words or not all(_is_number(word) for word in words[:3]):
        return None
    numbers = [float(word) for word in words[:3]]
    if len(numbers) < 3:
        numbers = [numbers[0]] * 3
    return (numbers[0], numbers[1], numbers[2])


def _number(values: Mapping[str, str], key: str, default: float) -> float:
    """The last word as a number (in `d -halo 0.5` an option comes first)."""
    words = values.get(key, "").split()
    if not words or not _is_number(words[-1]):
        return default
    number = float(words[-1])
    return number if abs(number) < float("inf") else default


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
