"""Layers of a surface -> one diffuse part and one lobe, which reflect as much of even light, and a clear coat.

Layers with textures are joined texel by texel, where their textures lie at the same places.
"""

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Bytes, Float64
from framearray_cli.base.colour import linear_from_srgb, srgb8_from_linear

from .materials import BLACK, MaterialSource, Split, SurfaceGloss, TexturePlaces
from .model import UV_SET, rgb3
from .textures import EncodedImage, mean_texel

DIELECTRIC = 0.04  # what is no metal reflects, face on
MOSTLY = 0.5  # the share of metal from which a smooth surface of another kind of file becomes a mirror
GRAZING = 1 / 21.0  # the mean of (1 - cos)^5 over even light is 2 / (6 x 7) [Schlick94]
LOBE = DIELECTRIC + (1 - DIELECTRIC) * GRAZING  # share of even light that the lobe of what is no metal reflects
BRIGHT = 1.5 * DIELECTRIC  # what is no metal gets a little of it where it reflects more, face on
_STEPS, _KNOTS = 48, 33  # of the grid that the rim of cloth is integrated on, in each direction; of its table
_BRIGHTNESS = np.array([0.299, 0.587, 0.114])
ROWS_AT_ONCE = 64  # of texels that are joined
WHITE = (1.0, 1.0, 1.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Slot:
    """A value of a surface: a constant, or scale * texel + bias.

    Attributes:
        scale: a number or a colour, (3,); without texture the value itself.
        image: an image, or the index of a texture; None without.
        channel: of the texture, from 0 to 3; -1: its colour.
        places: of the texture.
    """

    scale: Any = 0.0
    image: EncodedImage | int | None = None
    channel: int = -1
    bias: Any = 0.0
    places: TexturePlaces = field(default_factory=TexturePlaces)

    def of(self, texels: Float64 | None) -> Float64:
        """Values of texels (..., 4) from 0 to 1; None: of 1."""
        found: Any = 1.0
        if texels is not None:
            found = texels[..., self.channel] if self.channel >= 0 else linear_from_srgb(texels[..., :3])
        return np.asarray(np.maximum(self.scale * found + self.bias, 0.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class LayeredSource(MaterialSource):
    """A material of a file that may have layers, while it is read."""

    def layered(
        self, surface: SurfaceGloss | Split, texture: int, ior: float, layers: Sequence[Slot]
    ) -> tuple[SurfaceGloss | Split, int]:
        """Join the layers of a surface, texel by texel where they have textures; clear coats stay a lobe of their own.

        Args:
            texture: of the base colour, or -1.
            ior: index of refraction, where the surface is no metal.
            layers: tint and weight of what it reflects then, colour and roughness of the rim of cloth, weight and
                roughness of a clear coat.

        Returns:
            the surface, and the texture of its base colour.
        """
        layers = [*layers]
        for k in (2, 4):
            if not np.any(layers[k].scale):
                layers[k : k + 2] = Slot(scale=layers[k].scale), Slot()
        tint, weight, sheen, _, coat, _ = layers
        if not isinstance(surface, SurfaceGloss):
            if coat.scale and self.assets.as_file:
                self.note("clear coats of mirrors are left out")
            if np.any(sheen.scale):
                shade, (rim, cloth) = self._shade(texture), map(self.mean_of, self._here(layers[2:4], None))
                colour = over(rim * sheen_albedo(cloth), np.array(surface[0]) * shade)
                surface = rgb3(colour / shade), surface[1]
            return surface, texture
        f0 = ((ior - 1.0) / (ior + 1.0)) ** 2
        plain = tint.image is None and weight.image is None and not np.any(sheen.scale) and weight.scale == 1.0
        plain = plain and np.abs(f0 * tint.scale - DIELECTRIC).max() < 1e-6
        return (surface, texture) if plain and not coat.scale else self._joined(surface, texture, f0, layers, plain)

    def _joined(
        self, surface: SurfaceGloss, texture: int, f0: float, layers: Sequence[Slot], plain: bool
    ) -> tuple[SurfaceGloss | Split, int]:
        """Join the layers of a lobe that reflects f0 face on, see `joined`; `plain`: there is only a clear coat."""
        # 1. Textures at the places of the lobe; others count by their mean.
        colour, gloss = self._slot_of(texture, np.array(surface.base)), surface.texture
        rough, metal = self._slot_of(gloss, surface.roughness, 1), self._slot_of(gloss, surface.metallic, 2)
        found = [slot.places for slot in layers if slot.image is not None]
        places = next((p for p in found if p.same(colour.places)), found[0] if found else colour.places)
        places = rough.places if gloss >= 0 else places
        apart, here = texture >= 0 and not places.same(colour.places), self._here(layers, places)
        # 2. Their means.
        shade = self._shade(texture)
        means = [shade * surface.base, *map(self.mean_of, (rough, metal, *here))]
        base, roughness, metallic, even = joined(*means[:7], f0=f0)
        coat, factor = float(means[7]), surface.base
        if not plain:
            factor = rgb3(np.minimum(base / shade, np.maximum(factor, 1.0)))
        if all(slot.image is None for slot in here):
            if coat == 0 and means[2] == 0 and means[4] < MOSTLY:
                return (rgb3(even / shade), BLACK), texture
            if gloss < 0:
                lobe = SurfaceGloss(base=factor, roughness=float(roughness), metallic=float(metallic))
                return replace(lobe, coat=coat, coat_roughness=float(means[8])), texture
            if coat == 0 and (roughness, metallic) == (means[1], means[2]):
                return replace(surface, base=factor), texture
        # 3. Their texels.
        shown = not plain and not apart

        def blend(*values: Float64) -> tuple[Any, ...]:
            base, roughness, metallic, _ = joined(*values[:7], f0=f0)
            return base if shown else None, values[7], roughness, metallic, values[8]

        slots = (Slot(scale=means[0]) if apart else colour, rough, metal, *here)
        new, gloss = self._bake((f0, shown), slots, blend, places)
        self.textures.replaced |= {surface.texture: gloss} | ({texture: new} if shown else {})
        lobe = SurfaceGloss(base=WHITE if shown else factor, roughness=1.0, metallic=1.0, texture=gloss)
        return replace(lobe, coat=float(coat > 0), coat_roughness=1.0), new if shown else texture

    def with_specular(self, base: Float64, texture: int, specular: Slot, rough: Slot) -> tuple[SurfaceGloss, int]:
        """Describe diffuse and specular colours by base colour and metal, texel by texel if all lie at one place.

        Args:
            base, texture: factor and texture of the diffuse colour.

        Returns:
            the gloss, and the texture of its base colour.
        """
        colour, places = self._slot_of(texture, base), specular.places
        if specular.image is not None and (texture < 0 or colour.places.same(places)):

            def blend(*values: Float64) -> tuple[Any, ...]:
                found, metallic = from_specular(*values[:2])
                return found, 1.0, values[2], metallic, 1.0

            new, gloss = self._bake(("specular",), (colour, specular, *self._here([rough], places)), blend, places)
            self.textures.replaced[texture] = new
            return SurfaceGloss(base=WHITE, roughness=1.0, metallic=1.0, texture=gloss), new
        if specular.image is not None:
            self.note("specular textures with texture coordinates of their own count by their mean")
        shade = self._shade(texture)
        found, metal = from_specular(base * shade, self.mean_of(specular))
        metallic = float(metal) if metal > MOSTLY else 0.0  # a little metal would make a smooth surface a mirror
        return SurfaceGloss(base=rgb3(found / shade), roughness=float(self.mean_of(rough)), metallic=metallic), texture

    def mean_of(self, slot: Slot) -> Float64:
        """The value of a slot by the mean of its texture."""
        if isinstance(slot.image, int):
            return slot.of(mean_texel(self.textures.textures[slot.image]))
        return slot.of(self.textures.mean(slot.image, colours=slot.channel < 0))

    def _shade(self, texture: int) -> Float64:
        """(3,) mean of the colours of a texture, above 0; 1 of -1."""
        return np.asarray(np.maximum(self.mean_of(self._slot_of(texture, np.ones(3))), 1e-3))

    def _slot_of(self, texture: int, scale: Any, channel: int = -1) -> Slot:
        """A slot of a texture that is placed, or -1."""
        if texture < 0:
            return Slot(scale=scale)
        sampler = self.textures.samplers[texture]
        places = replace(self.places[sampler >> UV_SET], sampler=sampler & (1 << UV_SET) - 1)
        return Slot(scale=scale, image=texture, channel=channel, places=places)

    def _here(self, slots: Sequence[Slot], places: TexturePlaces | None) -> list[Slot]:
        """Slots, with means for the textures that lie elsewhere, and a note."""
        apart = [slot.image is not None and (places is None or not slot.places.same(places)) for slot in slots]
        if any(apart) and self.assets.as_file:
            self.note("textures of layers with texture coordinates of their own count by their mean")
        return [Slot(scale=self.mean_of(slot)) if a else slot for slot, a in zip(slots, apart, strict=True)]

    def _bake(
        self, key: Hashable, slots: Sequence[Slot], blend: Callable[..., tuple[Any, ...]], places: TexturePlaces
    ) -> tuple[int, int]:
        """Make textures of base colour and gloss of slots whose textures lie at the same places.

        Args:
            key: of `blend`.
            slots: the first is the base colour, whose alpha stays.
            blend: values of slots -> base colour, or None, and, if wanted, the four channels of gloss.

        Returns:
            their indices; -1 of none.
        """

        def find() -> tuple[Bytes | None, Bytes | None]:
            images = [self._texels(slot) for slot in slots]
            height, width = np.max([(1, 1), *(image.shape[:2] for image in images if image is not None)], axis=0)
            base, gloss = (np.full((height, width, 4), 255, np.uint8) for _ in range(2))
            columns, found, numbers = np.arange(width), None, list[Any]()
            for first in range(0, height, ROWS_AT_ONCE):
                rows = np.arange(first, min(first + ROWS_AT_ONCE, height))
                texels = [
                    None if i is None else i[np.ix_(rows * len(i) // height, columns * i.shape[1] // width)] / 255.0
                    for i in images
                ]
                found, *numbers = blend(*(slot.of(some) for slot, some in zip(slots, texels, strict=True)))
                if found is not None:
                    base[rows, :, :3] = srgb8_from_linear(found.astype(np.float32))
                    base[rows, :, 3] = 255 if texels[0] is None else np.rint(255.0 * texels[0][..., 3])
                for channel, values in enumerate(numbers):
                    gloss[rows, :, channel] = np.rint(255.0 * np.clip(values, 0.0, 1.0))
            return None if found is None else base, gloss if numbers else None

        values = [(getattr(s.image, "key", s.image), s.channel, str(s.scale), str(s.bias)) for s in slots]
        new, gloss = self.textures.pair((key, *values), find)
        return self.placed(new, places), self.placed(gloss, places)

    def _texels(self, slot: Slot) -> Bytes | None:
        """The texels of a slot; None without texture, or if it cannot be read."""
        if isinstance(slot.image, int):
            return self.textures.textures[slot.image]
        return None if slot.image is None else self.textures.decode(slot.image, numbers=slot.channel >= 0)


def over(share: Float64, colour: Float64) -> Float64:
    """Share of even light, (..., 3), that a layer and the colour under it reflect."""
    return np.asarray(share + (1.0 - np.minimum(share.max(axis=-1, keepdims=True), 1.0)) * colour)


def joined(
    colour: Float64, roughness: Float64, metal: Float64, tint: Float64, weight: Float64, sheen: Float64, cloth: Float64,
    *, f0: float,
) -> tuple[Float64, Float64, Float64, Float64]:  # fmt: skip
    """Join the layers of a surface.

    Where it reflects less than half, it has no highlight; where more than BRIGHT, a little metal.

    Args:
        colour, tint, sheen: (..., 3) colours: base, reflection of what is no metal, and rim of cloth.
        roughness, metal, weight, cloth: (...,) roughness and metal; weight of the reflection; roughness of the rim.
        f0: reflection face on.

    Returns:
        base colour, roughness and metal, and the share of even light, (..., 3), of what is no metal.
    """
    weights, share, edge = weight[..., None], metal[..., None], sheen * sheen_albedo(cloth)[..., None]
    reflected = np.minimum(f0 * tint, 1.0) * weights
    even = over(edge, over(reflected + (weights - reflected) * GRAZING, colour))
    bright, (tinted, more) = (reflected.mean(axis=-1) > BRIGHT) & ~edge.any(axis=-1), from_specular(colour, reflected)
    base = np.where(bright[..., None], tinted, np.maximum(even - LOBE, 0.0) / (1.0 - LOBE))
    base = share * over(edge, colour) + (1.0 - share) * base
    roughness = np.where((weight < MOSTLY) & (metal < MOSTLY), 1.0, roughness)
    return base, roughness, metal + np.where(bright, (1.0 - metal) * more, 0.0), even


def sheen_albedo(roughness: Any) -> Float64:
    """Share of even light that the rim of white cloth reflects, mean over all directions [Estevez17, Neubelt13]."""
    return np.asarray(np.interp(roughness, *_albedos_of_cloth()))


@cache
def _albedos_of_cloth() -> tuple[Float64, Float64]:
    """Roughnesses, and the shares of even light that rims reflect."""
    knots, cosine = np.linspace(0.0, 1.0, _KNOTS), (np.arange(_STEPS) + 0.5) / _STEPS
    v, l, angle = np.meshgrid(cosine, cosine, np.pi * cosine, indexing="ij", sparse=True)
    between = np.sqrt((1 - v * v) * (1 - l * l)) * np.cos(angle) + v * l
    sine2 = 1 - np.minimum((v + l) ** 2 / (2 + 2 * between), 1.0)
    found = []
    for alpha in np.maximum(knots, 0.07) ** 2:
        lobe = (2 + 1 / alpha) * sine2 ** (0.5 / alpha) / (2 * np.pi) / (4 * (v + l - v * l))
        found.append(4 * np.pi * (lobe * v * l).mean())
    return knots, np.array(found)


def from_specular(diffuse: Sequence[float] | Float64, specular: Sequence[float] | Float64) -> tuple[Float64, Float64]:
    """Convert diffuse and specular colours to base colours, and metal [KHR_materials_pbrSpecularGlossiness].

    Metal is what makes F0, the mean of 0.04 and the base colour by metal, as bright as the specular colour.

    Args:
        diffuse, specular: (..., 3) linear.

    Returns:
        (..., 3) and (...,).
    """
    diffuse, specular = np.asarray(diffuse, np.float64), np.asarray(specular, np.float64)
    rest = 1.0 - np.minimum(specular.max(axis=-1), 1.0)
    d, s = (np.sqrt((colour * colour) @ _BRIGHTNESS) for colour in (diffuse, specular))
    b = d * rest / (1 - DIELECTRIC) + s - 2 * DIELECTRIC
    root = np.sqrt(np.maximum(b * b - 4 * DIELECTRIC * (DIELECTRIC - s), 0.0))
    metallic = np.where(s > DIELECTRIC, np.clip((root - b) / (2 * DIELECTRIC), 0.0, 1.0), 0.0)
    metal, rest = metallic[..., None], rest[..., None]
    of_diffuse = diffuse * rest / (1 - DIELECTRIC) / np.maximum(1 - metal, 1e-6)
    of_specular = (specular - DIELECTRIC * (1 - metal)) / np.maximum(metal, 1e-6)
    share = metal * metal
    return np.clip(of_diffuse * (1 - share) + of_specular * share, 0.0, 1.0), metallic
