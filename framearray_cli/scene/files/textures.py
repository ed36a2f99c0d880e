"""Images -> RGBA texels, through Pillow, or OpenImageIO for floats; height maps -> normal maps."""

import hashlib
import io
import math
from collections.abc import Callable, Hashable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from types import MappingProxyType
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Bytes, Float32, Float64
from framearray_cli.base.colour import srgb_from_linear
from framearray_cli.base.errors import OutputError, SceneError
from framearray_cli.base.openimage import colour_channels, holds_floats, mend_radiance, pixels_of

from .assets import AssetError, Limit
from .model import Notes

LENGTH_ERROR = 0.15  # how far the length of a vector of a normal map may be from 1, by compression and scaling
LEAST_NORMALS = 0.75  # of the texels of a normal map, at least, are vectors of length 1 that point up
# How far blue may be from red, in the mean, in a height map: light greys have a length near 1, too.
GREY_DIFFERENCE = 0.05
VECTOR_ERROR = 0.03  # as LENGTH_ERROR, for floats, which only scaling makes longer or shorter
LEAST_NEGATIVE = 0.01  # of the vectors of a normal map lean to negative x or y; codes have no sign


def holds_normals(texels: Bytes) -> bool:
    """True if an image (height, width, 4) holds unit vectors that point up, and not heights."""
    red, green, blue = (texels[..., k].astype(np.float64) / 127.5 - 1 for k in range(3))
    if abs(blue - red).mean() < GREY_DIFFERENCE:
        return False
    length = np.sqrt(red * red + green * green + blue * blue)
    return bool(((abs(length - 1) < LENGTH_ERROR) & (blue > 0)).mean() >= LEAST_NORMALS)


def _holds_vectors(values: Float32) -> bool:
    """True if floats (height, width, 3) are vectors of length 1 with signs, and not codes from 0 to 1."""
    if (values[..., :2] < 0).any(axis=2).mean() <= LEAST_NEGATIVE:
        return False
    length = np.linalg.norm(np.clip(values, -2.0, 2.0), axis=2)  # clipped: squares of radiance may be infinite
    return bool((abs(length - 1) < VECTOR_ERROR).mean() >= LEAST_NORMALS)


def normals_of_heights(texels: Bytes) -> Bytes:
    """The normal map of a height map, both (height, width, 4), row 0 on top; the image repeats.

    A height is the mean of red, green and blue, from 0 to 1, and 1 is as high as a texel is wide.
    """
    height: Float64 = texels[..., :3].mean(axis=2) / 255
    along_u = (np.roll(height, -1, axis=1) - np.roll(height, 1, axis=1)) / 2
    along_v = (np.roll(height, 1, axis=0) - np.roll(height, -1, axis=0)) / 2
    normal = np.stack([-along_u, -along_v, np.ones_like(height)], axis=2)
    normal /= np.sqrt((normal * normal).sum(axis=2, keepdims=True))
    codes = np.rint((normal + 1) * 127.5).astype(np.uint8)
    return np.concatenate([codes, np.full_like(codes[..., :1], 255)], axis=2)


MAX_TEXELS = 2**31 - 1  # texel indices are int32
MAX_BYTE = 255.0
# The kinds of images that scenes come with. Pillow opens others too, some through external programs (EPS).
FORMATS = ("PNG", "JPEG", "WEBP", "TGA", "BMP", "TIFF", "GIF", "DDS", "JPEG2000", "AVIF", "PSD", "PPM", "PCX", "SGI")
SEVERAL = "MPO"  # what Pillow calls a JPEG of several pictures, as phones write them
KEPT = 8  # bytes per texel: RGBA, twice while the textures of a scene are joined
FLOATS = 48  # bytes per texel while an image of floats is decoded
DECODING = 16  # bytes per texel while an image is decoded: Pillow's own, RGBA, and copies on the way
# A camera's JPEG has at most ten scans. Decoding one scan takes as long as decoding a whole picture.
MOST_SCANS = 100
SCAN = b"\xff\xda"
UDIM = "<UDIM>"  # stands for the number of a tile in names of files
TILES, ALONG_U = range(1001, 1101), 10  # numbers of tiles, row by row, from the lowest row up
MOST_TILED = 80_000_000  # pixels of an image that tiles are joined to

SRGB, AUTO = 0.0, -1.0  # stand for exponents: codes are sRGB; linear if grey, or of 16 bits without profile, else sRGB

_Read = TypeVar("_Read")


class EncodedImage(NamedTuple):
    """An image that a scene names.

    Attributes:
        key: identifies it.
        label: names it in notes.
        read: returns its bytes; may raise AssetError.
        tiles: of an image in tiles, by column from the left and row from below; `read` then returns the first.
        gamma: of colours: exponent that makes its codes linear, SRGB, or AUTO: by UsdUVTexture's rule.
    """

    key: Hashable
    label: str
    read: Callable[[], bytes]
    tiles: Mapping[tuple[int, int], "EncodedImage"] = MappingProxyType({})
    gamma: float = SRGB

    @property
    def counts(self) -> tuple[int, int]:
        """Numbers of columns and rows of tiles: texture coordinates are divided by them."""
        columns, rows = np.max([(0, 0), *self.tiles], axis=0) + 1
        return int(columns), int(rows)


Channel = tuple[EncodedImage, int, float, float]  # one channel of an image, and the scale and bias of its values


@dataclass(slots=True)
class TextureTable:
    """The textures of a scene; each image is decoded once.

    An index is -1 if there is no image, and with a note if the image cannot be read.

    Attributes:
        replaced: textures that other ones stand for, unless another material uses them.
    """

    notes: Notes
    limit: Limit
    textures: list[Bytes] = field(default_factory=list)
    samplers: list[int] = field(default_factory=list)
    indices: dict[Hashable, int] = field(default_factory=dict)
    in_tiles: dict[Hashable, EncodedImage] = field(default_factory=dict)
    replaced: dict[int, int] = field(default_factory=dict)

    def index(self, image: EncodedImage | None, *, numbers: bool = False) -> int:
        """Return the index of a texture.

        Args:
            numbers: True if its values are no colours, see `decode_image`.

        Raises:
            SceneError: the image takes more memory than there is.
        """
        if image is None:
            return -1
        return self._once((image.key, numbers), lambda: self._index(image, numbers=numbers))

    def tiled(self, key: Hashable, label: str, read: Callable[[int], bytes]) -> EncodedImage:
        """Return an image of all tiles that exist, each read once; if none does, one that cannot be read.

        Args:
            read: returns the bytes of the tile with a number; may raise AssetError.
        """
        if key not in self.in_tiles:
            tiles = dict[tuple[int, int], EncodedImage]()
            for number in TILES:
                row, column = divmod(number - TILES[0], ALONG_U)
                with suppress(AssetError):
                    tiles[column, row] = EncodedImage((key, number), label, partial(bytes, read(number)))
            self.in_tiles[key] = EncodedImage(key, label, partial(read, TILES[0]), tiles)
        return self.in_tiles[key]

    def add(self, key: Hashable, label: str, image: Any) -> int:
        """Return the index of an image that Pillow has opened, as `index` does."""
        decoded = partial(decode_opened, image, label, self.limit, self.notes)
        return self._once(key, lambda: self._append(self._noted(decoded)))

    def sampled(self, index: int, sampler: int) -> int:
        """Return the index of a texture with the texels of another one, and its own sampler."""
        if index < 0 or sampler == 0:
            return index

        def find() -> int:
            self.textures.append(self.textures[index])
            self.samplers.append(sampler)
            return len(self.textures) - 1

        return self._once(("sampled", index, sampler), find)

    def cutout(self, image: EncodedImage) -> int:
        """Return the index of an opacity map: its alpha, or its brightness without alpha."""

        def find() -> int:
            texels = self.decode(image, numbers=True)
            if texels is None or texels[..., 3].min() < MAX_BYTE:
                return self.index(image)
            texels[..., 3] = np.rint(texels[..., :3].mean(axis=2))
            return self._append(texels)

        return self._once(("opacity", image.key), find)

    def relief(self, image: EncodedImage) -> tuple[int, bool]:
        """Return the index of an image of normals, or of heights, which become normals; and True for heights."""

        def find() -> int:
            texels = self.decode(image, numbers=True)
            if texels is None or holds_normals(texels):
                return self.index(image, numbers=True)
            return self._append(normals_of_heights(texels))

        found = self._once(("relief", image.key), find)
        return found, found != self.indices.get((image.key, True), -1)

    def made(self, key: Hashable, find: Callable[[], Bytes | None]) -> int:
        """Return the index of a texture that is computed; -1 of none."""
        return self._once(key, lambda: self._append(find()))

    def rest(self, image: EncodedImage, share: float) -> int:
        """Return the index of a texture whose alpha is 1 less the red of an image times a share."""

        def find() -> Bytes | None:
            if (texels := self.decode(image, numbers=True)) is not None:
                texels[..., 3] = np.rint(MAX_BYTE - min(share, 1.0) * texels[..., 0])
            return texels

        return self.made(("rest", image.key, share), find)

    def packed(self, green: Channel | None, blue: Channel | None) -> int:
        """Index of a texture whose green and blue come from channels of images; 255 where there is none."""
        channels = (green, blue)
        key = ("packed", *(one and (one[0].key, *one[1:]) for one in channels))
        return self.made(key, lambda: self._pack(channels))

    def _pack(self, channels: tuple[Channel | None, Channel | None]) -> Bytes | None:
        """The texels of `packed`; None if one of the images cannot be read."""
        planes: dict[int, NDArray[Any]] = {}
        for place, one in zip((1, 2), channels, strict=True):
            if one is not None:
                image, channel, scale, bias = one
                if (texels := self.decode(image, numbers=True)) is None:
                    return None
                planes[place] = texels[..., channel] * scale + bias * MAX_BYTE
        height, width = np.max([plane.shape for plane in planes.values()], axis=0)
        packed = np.full((height, width, 4), 255, np.uint8)
        for place, plane in planes.items():
            rows, columns = (np.arange(n) * m // n for n, m in zip((height, width), plane.shape, strict=True))
            packed[..., place] = np.rint(np.clip(plane[np.ix_(rows, columns)], 0.0, MAX_BYTE))
        return packed

    def pair(self, key: Hashable, find: Callable[[], tuple[Bytes | None, Bytes | None]]) -> tuple[int, int]:
        """Indices of two textures that belong together; -1 of none."""
        if (key, 0) not in self.indices:
            self.indices |= {(key, k): self._append(texels) for k, texels in enumerate(find())}
        return self.indices[key, 0], self.indices[key, 1]

    def alpha_range(self, index: int) -> tuple[float, float]:
        """Lowest and highest alpha of a texture in [0, 1]; (1, 1) for no texture."""
        if index < 0:
            return 1.0, 1.0
        alpha = self.textures[index][..., 3]
        return float(alpha.min()) / MAX_BYTE, float(alpha.max()) / MAX_BYTE

    def mean(self, image: EncodedImage | None, *, colours: bool = False) -> Float64 | None:
        """(4,) mean in [0, 1] of the raw channels of an image that holds numbers, or sRGB colours; not kept."""
        tiles = [] if image is None else [one._replace(gamma=image.gamma) for one in image.tiles.values()] or [image]
        found = [mean_texel(texels) for one in tiles if (texels := self.decode(one, numbers=not colours)) is not None]
        return np.asarray(np.mean(found, axis=0)) if found else None

    def _once(self, key: Hashable, find: Callable[[], int]) -> int:
        if key not in self.indices:
            self.indices[key] = find()
        return self.indices[key]

    def _index(self, image: EncodedImage, *, numbers: bool) -> int:
        """Decode an image, unless its bytes are already there under another key."""
        if image.tiles:
            return self._append(self.decode(image, numbers=numbers))
        data = self._noted(image.read)
        if data is None:
            return -1
        same = ("bytes", hashlib.sha256(data).digest(), numbers and holds_floats(data), not numbers and image.gamma)
        again = image._replace(read=lambda: data)
        return self._once(same, lambda: self._append(self.decode(again, numbers=numbers)))

    def decode(self, image: EncodedImage, *, numbers: bool = False) -> Bytes | None:
        """The texels of an image, not kept; None, with a note, if it cannot be read."""
        if image.tiles:
            return self._joined(image, numbers=numbers)
        return self._noted(lambda: decode_image(image, self.limit, self.notes, numbers=numbers))

    def _joined(self, image: EncodedImage, *, numbers: bool) -> Bytes | None:
        """The texels of an image in tiles, all as large as the largest; where one is missing, it is black."""
        from PIL import Image

        (columns, rows), found = image.counts, dict[tuple[int, int], Any]()
        largest, reduced = MOST_TILED / (columns * rows), False
        for place, tile in image.tiles.items():
            if (texels := self.decode(tile._replace(gamma=image.gamma), numbers=numbers)) is not None:
                found[place] = Image.fromarray(texels)
                scale = (largest / math.prod(found[place].size)) ** 0.5
                if scale < 1:
                    found[place], reduced = found[place].resize([int(n * scale) or 1 for n in found[place].size]), True
        if not found:
            return None
        width, height = max((one.size for one in found.values()), key=math.prod)
        if reduced:
            self.notes.add(f"{image.label}: tiles are reduced to {width} x {height} pixels")
        size = columns * width, rows * height
        with self.limit.lend(f"an image of {size[0]} x {size[1]} pixels", KEPT * math.prod(size)):
            whole = Image.new("RGBA", size, (0, 0, 0, 255))
            for (column, row), one in found.items():
                whole.paste(one.resize((width, height)), (column * width, (rows - 1 - row) * height))
            return np.array(whole)

    def _noted(self, read: Callable[[], _Read]) -> _Read | None:
        """Read something; None, with a note, if that fails."""
        try:
            return read()
        except AssetError as error:
            self.notes.add(f"texture left out, {error}")
            return None

    def _append(self, texels: Bytes | None) -> int:
        if texels is None:
            return -1
        n_texels = sum(texture.shape[0] * texture.shape[1] for texture in different(self.textures))
        if n_texels + texels.shape[0] * texels.shape[1] > MAX_TEXELS:
            raise SceneError(f"the textures have more than {MAX_TEXELS} texels in all; make them smaller")
        self.limit.take("textures", KEPT * texels.shape[0] * texels.shape[1])
        self.textures.append(texels)
        self.samplers.append(0)
        return len(self.textures) - 1


def different(textures: Sequence[Bytes]) -> list[Bytes]:
    """The arrays of textures, each once."""
    return list({id(texels): texels for texels in textures}.values())


def mean_texel(texels: Bytes) -> Float64:
    """(4,) mean of the code values of a texture, in [0, 1]."""
    return np.asarray(texels.reshape(-1, 4).mean(axis=0, dtype=np.float64) / MAX_BYTE)


def decode_image(encoded: EncodedImage, limit: Limit, notes: Notes, *, numbers: bool = False) -> Bytes:
    """Decode an image of a kind that scenes come with.

    Args:
        notes: gets what was repaired.
        numbers: True if its values are no colours: floats are then kept as they are, vectors from -1 to 1 as codes.

    Returns:
        (height, width, 4) uint8 RGBA, row 0 on top.

    Raises:
        AssetError: not an image, or broken.
        SceneError: it takes more memory than there is.
    """
    from PIL import Image, UnidentifiedImageError

    data, label = encoded.read(), encoded.label
    try:
        with Image.open(io.BytesIO(data), formats=FORMATS) as image:
            if image.format in ("JPEG", SEVERAL) and data.count(SCAN) > MOST_SCANS:
                raise AssetError(f"{label}: expected an image of at most {MOST_SCANS} scans, got {data.count(SCAN)}")
            stored = str(image.tile)  # PNG of 16 bits is opened with 8
            deep = ";16" in stored and "icc_profile" not in image.info
            auto = float(image.mode[0] in "1LIF" or "'LA" in stored or deep)
            gamma = auto if encoded.gamma == AUTO else encoded.gamma
            opened = decode_opened(image, label, limit, notes)
            if gamma != SRGB and not numbers:
                codes = srgb_from_linear((np.arange(256) / MAX_BYTE) ** gamma)
                opened[..., :3] = np.rint(codes * MAX_BYTE).astype(np.uint8)[opened[..., :3]]
            return opened
    except (AssetError, SceneError):
        raise
    except Image.DecompressionBombError as error:
        raise SceneError(f"{label}: {str(error).rstrip('.')}; make the image smaller") from error
    except UnidentifiedImageError as error:
        if (texels := _decode_floats(data, label, limit, notes, numbers=numbers)) is not None:
            return texels
        raise AssetError(f"{label}: not an image that can be read; PNG, JPEG and EXR are") from error
    except Exception as error:  # broken images make Pillow raise anything
        raise AssetError(f"{label}: not an image that can be read ({type(error).__name__}: {error})") from error


def _decode_floats(data: bytes, label: str, limit: Limit, notes: Notes, *, numbers: bool) -> Bytes | None:
    """Decode an EXR or HDR, whose values are linear, as codes from 0 to 255; None if it is neither.

    Raises:
        AssetError: it is broken.
        SceneError: it takes more memory than there is.
    """

    def taken(width: int, height: int) -> None:
        with limit.lend(f"an image of {width} x {height} pixels", (KEPT + FLOATS) * width * height):
            pass

    try:
        if (found := pixels_of(data, taken)) is None:
            return None
        names, pixels = found
        channels = colour_channels(names) or [0, 0, 0]
        values = pixels[..., channels]
        if numbers and _holds_vectors(values):
            values = np.clip(values / 2 + 0.5, 0.0, 1.0)
        values, note = mend_radiance(values)
    except OutputError as error:
        raise AssetError(f"{label}: {error}") from error
    above = (values > 1).any(axis=-1).mean()
    if above:
        notes.add(f"{label}: values above 1, in {above:.2g} of the image, count as 1")
    if note:
        notes.add(f"{label}: {note}")
    values = np.minimum(values, 1.0)
    codes = np.rint((values if numbers else srgb_from_linear(values)) * MAX_BYTE).astype(np.uint8)
    alpha = pixels[..., names.index("A")] if "A" in names else np.ones(codes.shape[:2], np.float32)
    return np.dstack([codes, np.rint(np.clip(alpha, 0.0, 1.0) * MAX_BYTE).astype(np.uint8)])


def decode_opened(image: Any, label: str, limit: Limit, notes: Notes) -> Bytes:
    """Decode the texels of an image that Pillow has opened; its size counts before any of it is decoded.

    Raises:
        AssetError: empty, broken, or of a kind that scenes do not come with.
        SceneError: it takes more memory than there is.
    """
    texels = image.width * image.height
    if image.format not in (*FORMATS, SEVERAL) or not texels:
        raise AssetError(
            f"{label}: expected a PNG or JPEG, got {image.format} of {image.width} x {image.height} pixels"
        )
    with limit.lend(f"an image of {image.width} x {image.height} pixels", (KEPT + DECODING) * texels):
        try:
            texels, note = rgba(image)
            if note:
                notes.add(f"{label}: {note}")
            return texels
        except MemoryError:
            raise
        except OutputError as error:
            raise AssetError(f"{label}: {error}") from error
        except Exception as error:  # as above
            raise AssetError(f"{label}: not an image that can be read ({type(error).__name__}: {error})") from error


def rgba(image: Any) -> tuple[Bytes, str]:
    """Convert a Pillow image of any mode to (height, width, 4) uint8 RGBA; also return a note on repairs, or "".

    Pillow clips 16-bit and float greys at 255 instead of scaling them, so these are scaled here.
    """
    note = ""
    if image.mode.startswith("I"):
        wide = np.asarray(image).astype(np.int64)
        grey = np.clip(wide >> 8, 0, 255).astype(np.uint8)
    elif image.mode == "F":
        floats, note = mend_radiance(np.asarray(image, np.float32)[..., None])
        grey = np.rint(np.minimum(floats[..., 0], 1.0) * MAX_BYTE).astype(np.uint8)
    else:
        return np.array(image.convert("RGBA"), dtype=np.uint8), note
    return np.dstack([grey, grey, grey, np.full_like(grey, 255)]), note
