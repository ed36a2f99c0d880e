"""Transparency of a material -> opaque, cut out, or left out; the same rules for every file format."""

from dataclasses import dataclass

from .model import Notes
from .textures import TextureTable

TRANSMISSIVE_ALPHA = 0.25  # a surface that stops less light than this is taken as glass and left out for now
CUTOFF = 0.5  # where a blended texture turns from hole to surface; also glTF's default for masks


@dataclass(frozen=True, slots=True, kw_only=True)
class Opacity:
    """The transparency fields of a `Material`."""

    alpha: float = 1.0
    alpha_texture: int = -1
    alpha_cutoff: float = 0.0
    left_out: str = ""


def masked(alpha: float, texture: int, cutoff: float, textures: TextureTable) -> Opacity:
    """Opacity of a material whose points are absent where alpha is below the cutoff."""
    lowest, highest = textures.alpha_range(texture)
    if alpha * lowest >= cutoff:
        return Opacity()
    if alpha * highest < cutoff:
        return Opacity(left_out="cut out")
    return Opacity(alpha=alpha, alpha_texture=texture, alpha_cutoff=cutoff)


def blended(name: str, alpha: float, texture: int, textures: TextureTable, notes: Notes) -> Opacity:
    """Opacity of a material that lets light through by alpha: glass, a cut-out texture, or nearly opaque."""
    lowest, highest = textures.alpha_range(texture)
    if alpha * highest < TRANSMISSIVE_ALPHA:
        notes.add("transmissive materials are left out", name)
        return Opacity(left_out="transmissive")
    if lowest < CUTOFF <= highest:
        notes.add("textures with partial transparency are cut out at half opacity", name)
        return Opacity(alpha_texture=texture, alpha_cutoff=CUTOFF)
    if alpha * lowest < 1:
        notes.add("partly transparent materials are taken as opaque", name)
    return Opacity()
