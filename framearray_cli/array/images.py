"""Image files: written whole, read back, checked, and reduced to a smaller size.

EXR and TIFF go through OpenImageIO, except uncompressed EXR, which `exr.py` encodes. OpenImageIO reports success for a
PNG on a full disk and reads half a JPEG without an error, so PNG and JPEG go through Pillow, in memory.
"""

import io
import math
import os
import shutil
import struct
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Bytes, Float32, Image
from framearray_cli.base.colour import linear_from_srgb8, srgb8_from_linear
from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import reason, require_file, write_bytes
from framearray_cli.base.openimage import check_size, oiio, read_pixels, read_rgb, write_pixels
from framearray_cli.base.units import counted

from .cryptomatte import PREFIX
from .exr import Attributes, encode_plain_exr, is_plain, spec_of

Extension = Literal["exr", "png", "tif", "jpg"]
Compression = Literal["none", "rle", "zip", "zips", "piz", "pxr24", "b44", "b44a", "dwaa", "dwab"]

DWA: tuple[Compression, ...] = ("dwaa", "dwab")
HALF_MAX = 65504.0  # the largest half; values beyond become infinite
# Noise hardly compresses: level 1 takes 6 ms for 400x300, level 4 (zip's own default) 10 ms and saves 7 %.
_LEVELS = {"zip": "zip:1", "zips": "zips:1"}
SUN_HOURS = "sun_hours"  # layer with a channel per day of a sun study, and one for all days
_COLOURS = frozenset("RGBA")  # letters of channels for which the 11 bits of a half suffice
POSITION_ORIGIN = "framearray:position_origin"  # what the header calls the point that positions are relative to
COLOUR_ID, SCENE_LIGHT, DATA = "colorInteropID", "lin_rec709_scene", "data"  # what EXR says of its channels
FOR_SCREENS = ("png", "jpg")  # formats of 8-bit sRGB; the others keep the radiance
_SAME = {"jpeg": "jpg", "tiff": "tif"}
_PNG_HEAD, _JPEG_HEAD = b"\x89PNG\r\n\x1a\n", b"\xff\xd8"
# Exceptions of Pillow for broken files, apart from OSError.
_PILLOW_ERRORS = (SyntaxError, ValueError, EOFError, IndexError, KeyError, TypeError, struct.error, zlib.error)
OPAQUE_CODE = 255
WITH_ALPHA = ("exr", "png", "tif")  # formats that have an alpha channel
# Pixels that are counted, about; every second, third, ... row and column of a larger image.
COUNTED = 2048
# The largest radiance that rounds to code 0 of an sRGB screen.
CODE_0 = 0.5 / 255 / 12.92


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageFormat:
    """Format of image files and its options.

    Attributes:
        format: exr and tif keep linear radiance; png and jpg are sRGB, 8 bits, clipped to [0, 1].
        compression: of EXR; zip instead of DWA, which loses precision, in files of floats, with alpha or
            with layers.
        half: how EXR stores values: "auto" as half, or as float in an image with values beyond 65504; "always" as
            half, such values clamped to 65504; "never" as float. TIFF is always float.
        quality: of JPEG, 1 to 100.
        exposure: stops added to what png and jpg show; exr and tif keep the radiance as it is.
    """

    format: Extension = "exr"
    compression: Compression = "none"
    half: Literal["auto", "always", "never"] = "auto"
    quality: int = 95
    exposure: float = 0.0

    @property
    def composes_halves(self) -> bool:
        """True if `write_image` accepts halves; with "auto" only images without values beyond 65504."""
        return self.format == "exr" and self.half != "never"


def format_name(path: Path | str) -> str:
    """Return the format of a file's suffix in its usual spelling: "png", "jpg"; "" without a suffix."""
    suffix = Path(path).suffix.lower()[1:]
    return _SAME.get(suffix, suffix)


def write_image(
    path: Path,
    image: Image | NDArray[np.float16],
    image_format: ImageFormat,
    attributes: Attributes | None = None,
    more: Mapping[str, Image] | None = None,
    alpha: Float32 | None = None,
) -> None:
    """Write one image, whole or not at all; equal images give equal bytes.

    Several threads may write different images at once.

    Args:
        path: the file; its suffix is ignored, `image_format.format` decides.
        image: (h, w, 3), linear, finite; halves, for EXR only, are stored unchecked.
        image_format: format and its options.
        attributes: EXR keeps all of them, PNG text and numbers, TIFF the program's name, JPEG none.
        more: images of the same shape that EXR stores as layers of these names, with the same precision.
        alpha: (h, w) coverage in [0, 1], by which the image is multiplied already; None: no alpha channel.

    Raises:
        ValueError: the image holds NaN or infinity.
        OutputError: the file cannot be written.
    """
    attributes = attributes or {}
    if image.dtype == np.float16:
        _write_exr(path, image, more or {}, image_format, attributes, alpha)
        return
    image = np.asarray(image, np.float32)
    largest = _largest(str(path), image)
    if image_format.format in FOR_SCREENS:
        write_codes(path, codes_of(image, image_format, alpha), image_format, attributes)
        return
    if image_format.format == "exr":
        half = image_format.half == "always" or (image_format.half == "auto" and largest <= HALF_MAX)
        _write_exr(path, _halves(image, largest) if half else image, more or {}, image_format, attributes, alpha)
    else:
        # Only plain text: other types of attribute can end the process in the TIFF writer.
        text = {name: value for name, value in attributes.items() if isinstance(value, str)}
        image = image if alpha is None else np.dstack([image, alpha])
        spec = spec_of(image.shape, list("RGBA")[: image.shape[-1]], ["float"] * image.shape[-1], text)
        spec.attribute("compression", "none")  # zip saves a fifth of a noisy float image and takes 20 times as long
        # else OpenImageIO fails to write an empty Exif directory and reports an error
        spec.attribute("tiff:write_exif", 0)
        write_pixels(path, "tiff", spec, image)


def codes_of(image: Image, image_format: ImageFormat, alpha: Float32 | None = None) -> NDArray[np.uint8]:
    """Return the pixels of an image (h, w, 3) of floats as PNG and JPEG show them, (h, w, 3 or 4)."""
    exposed = image * np.float32(2.0**image_format.exposure) if image_format.exposure else image
    if alpha is None:
        return srgb8_from_linear(exposed)
    shown, covered = unassociated(exposed, alpha)
    return np.dstack([srgb8_from_linear(shown), covered])


def _halves(image: Image, largest: float) -> NDArray[np.float16]:
    """Convert to halves; clamp first, as half a step above 65504 a half becomes infinite."""
    return (np.clip(image, -HALF_MAX, HALF_MAX) if largest > HALF_MAX else image).astype(np.float16)


def _write_exr(
    path: Path,
    image: Image | NDArray[np.float16],
    more: Mapping[str, Image],
    image_format: ImageFormat,
    attributes: Attributes,
    alpha: Float32 | None,
) -> None:
    """Write an image and its alpha channel, with others of the same number type as its layers."""
    kind = "half" if image.dtype == np.float16 else "float"
    layers = [_halves(layer, np.inf) if kind == "half" else layer for layer in more.values()]
    covered = [] if alpha is None else [alpha[..., None].astype(image.dtype)]
    names = [*"RGB", *"A"[: len(covered)]] + [f"{name}.{letter}" for name in more for letter in "RGB"]
    pixels = np.concatenate([image, *covered, *layers], axis=-1) if covered or layers else image
    compression = image_format.compression
    if compression in DWA and (kind == "float" or more or alpha is not None):
        compression = "zip"
    if compression == "none" and is_plain(attributes):
        write_bytes(path, encode_plain_exr(pixels, names, attributes))
        return
    spec = spec_of(pixels.shape, names, [kind] * len(names), attributes)
    spec.attribute("compression", _LEVELS.get(compression, compression))
    write_pixels(path, "openexr", spec, pixels)


def write_codes(
    path: Path, codes: Bytes, image_format: ImageFormat | None = None, attributes: Attributes | None = None
) -> None:
    """Write (h, w, 3) 8-bit codes as PNG or JPEG, whole or not at all.

    Args:
        path: the file.
        codes: the pixels.
        image_format: png (what None means) or jpg, and its quality.
        attributes: as in `write_image`.

    Raises:
        OutputError: the file cannot be written.
    """
    if image_format is not None and image_format.format == "jpg":
        write_bytes(path, encode_jpeg(codes, image_format.quality))
    else:
        write_bytes(path, encode_png(codes, attributes or {}))


def _is_half(name: str) -> bool:
    """Return True if a channel of a layer is a colour or a normal."""
    return name.startswith("normal.") or (name.split(".")[-1] in _COLOURS and not name.startswith(PREFIX))


def write_layers(path: Path, layers: Mapping[str, Float32], attributes: Attributes | None = None) -> None:
    """Write a multi-channel EXR, whole or not at all.

    Names follow OpenEXR's `layer.channel`: "obscurance.R", "normal.X", "depth.Z"; "samples" is a channel without a
    layer. Colours and normals up to 65504 are stored as half, all others, and mattes, as float.

    Args:
        path: the file.
        layers: channel name -> (h, w), finite; all of one shape, at least one.
        attributes: as in `write_image`.

    Raises:
        ValueError: a value is not finite.
        OutputError: the file cannot be written.
    """
    kinds = [
        "half" if _largest(f"{path}: {name}", layer) <= HALF_MAX and _is_half(name) else "float"
        for name, layer in layers.items()
    ]
    pixels = np.stack([np.asarray(layer, np.float32) for layer in layers.values()], axis=-1)
    spec = spec_of(pixels.shape, list(layers), kinds, attributes or {})
    spec.attribute("compression", _LEVELS["zip"])
    write_pixels(path, "openexr", spec, pixels)


def read_image(path: Path) -> Image:
    """Read an image as linear radiance: (h, w, 3) float32; PNG and JPEG are decoded from sRGB.

    An image with alpha is as before black: premultiplied. `read_alpha` reads its alpha.

    Raises:
        OutputError: the file is missing, damaged or truncated, or has no channels R, G, B.
    """
    if format_name(path) in FOR_SCREENS:
        codes = read_codes(path)
        light = linear_from_srgb8(np.ascontiguousarray(codes[..., :3]))
        return light if codes.shape[-1] == len("RGB") else light * _covered(codes)[..., None]
    return read_rgb(path)


def read_layers(path: Path) -> dict[str, Float32]:
    """Read every channel of an EXR: name -> (h, w) float32, in the order of the file (by name).

    Raises:
        OutputError: the file is missing, damaged or truncated.
    """
    names, pixels = read_pixels(path)
    return {name: np.ascontiguousarray(pixels[..., i]) for i, name in enumerate(names)}


def read_channels(path: Path, names: Sequence[str], resolution: tuple[int, int]) -> Float32:
    """Read some channels of an EXR, (h, w, n) float32.

    Raises:
        OutputError: the file is missing, damaged or of another size, or lacks one of them.
    """
    found = read_layers(path)
    if missing := [name for name in names if name not in found]:
        raise OutputError(f"{path}: expected the channel {missing[0]}, found {', '.join(found)}")
    pixels = np.stack([found[name] for name in names], axis=-1)
    require_size(path, pixels.shape, resolution)
    return pixels


def require_size(path: Path, shape: Sequence[int], resolution: tuple[int, int]) -> None:
    """Refuse a file whose pixels have the shape (h, w, ...), unless that is the expected width and height.

    Raises:
        OutputError: they have another size.
    """
    (width, height), (h, w) = resolution, shape[:2]
    if (w, h) != (width, height):
        raise OutputError(f"{path}: expected {width} x {height} pixels, got {w} x {h}")


def _largest(label: str, values: Float32) -> float:
    """Return the largest magnitude, and refuse NaN and infinity, which min and max pass on."""
    low, high = float(values.min()), float(values.max())
    if not (math.isfinite(low) and math.isfinite(high)):
        raise ValueError(f"{label}: not finite, {counted(int(np.count_nonzero(~np.isfinite(values))), 'value')}")
    return max(-low, high)


def read_codes(path: Path) -> Bytes:
    """Read the 8-bit sRGB codes of a PNG or JPEG: (h, w, 3) uint8, or (h, w, 4) with alpha.

    Raises:
        OutputError: the file is missing, damaged or truncated.
    """
    with open_picture(path) as picture:
        return np.asarray(picture if picture.mode == "RGBA" else picture.convert("RGB"))


@contextmanager
def open_picture(path: Path) -> Iterator[Any]:
    """Open a PNG or JPEG with Pillow; errors raised while it is in use name the file.

    Pillow's own `open` takes files of any format, and refuses sizes that a job may have.

    Raises:
        OutputError: the file is missing, damaged, of another format, or larger than any job's.
    """
    from PIL.JpegImagePlugin import JpegImageFile
    from PIL.PngImagePlugin import PngImageFile

    require_file(path)
    kind: Any = PngImageFile if path.suffix.lower() == ".png" else JpegImageFile
    try:
        with path.open("rb") as file:
            head = file.read(len(_PNG_HEAD))
        if not head.startswith(_PNG_HEAD if kind is PngImageFile else _JPEG_HEAD):
            raise OutputError(f"{path}: not an image, or damaged: it does not begin like {path.suffix[1:].upper()}")
        with kind(path) as picture:
            check_size(path, *picture.size)
            yield picture
    except OSError as error:
        raise OutputError(f"{path}: cannot be read: {reason(error)}") from error
    except _PILLOW_ERRORS as error:
        raise OutputError(f"{path}: damaged: {error}") from error


def encode_png(codes: Bytes, attributes: Attributes) -> bytes:
    """Encode (h, w, 3) 8-bit codes as PNG, or (h, w, 4) with alpha, in memory."""
    import PIL.Image
    import PIL.PngImagePlugin

    info = PIL.PngImagePlugin.PngInfo()
    info.add(b"sRGB", b"\0")  # says that the codes are sRGB; 0: perceptual intent
    for name, value in attributes.items():
        if isinstance(value, str | int | float | Fraction):
            info.add_text(name, str(value))
    buffer = io.BytesIO()
    PIL.Image.fromarray(codes).save(buffer, "PNG", compress_level=1, pnginfo=info)
    return buffer.getvalue()


def encode_jpeg(codes: Bytes, quality: int, comment: str = "") -> bytes:
    """Encode (h, w, 3) 8-bit codes as JPEG, in memory, without chroma subsampling, which makes coloured edges bleed.

    Args:
        comment: stands near the beginning of the file.
    """
    import PIL.Image

    buffer = io.BytesIO()
    PIL.Image.fromarray(codes).save(buffer, "JPEG", quality=quality, subsampling=0, comment=comment or None)
    return buffer.getvalue()


def unassociated(image: Image, alpha: Float32) -> tuple[Image, Bytes]:
    """Divide premultiplied linear light by alpha, as a PNG has it.

    8 bits cannot hold light where nothing is covered, as of a lamp before the sky: alpha is there the light itself.

    Args:
        image: (h, w, 3).
        alpha: (h, w) in [0, 1].

    Returns:
        Linear light that is not premultiplied, (h, w, 3); and codes of alpha, (h, w).
    """
    alpha = np.where(alpha > 0, alpha, np.clip(image.max(axis=-1), 0, 1)).astype(np.float32)
    covered = np.rint(alpha * OPAQUE_CODE).astype(np.uint8)
    return np.asarray(image / np.where(covered > 0, alpha, np.inf)[..., None], np.float32), covered


def _covered(codes: Bytes) -> Float32:
    """Decode the alpha of codes (h, w, 4)."""
    return codes[..., 3].astype(np.float32) / np.float32(OPAQUE_CODE)


def read_alpha(path: Path) -> Float32:
    """Read the alpha channel of an image, (h, w) float32 in [0, 1].

    Raises:
        OutputError: the file is missing, damaged or truncated, or has none.
    """
    kind = format_name(path)
    if kind == "png":
        codes = read_codes(path)
        if codes.shape[-1] == len("RGBA"):
            return _covered(codes)
    elif kind in WITH_ALPHA:
        names, pixels = read_pixels(path)
        if "A" in names:
            return np.ascontiguousarray(pixels[..., names.index("A")])
    raise OutputError(f"{path}: expected an alpha channel, found none; render again with output.alpha = true")


def pixel_shares(
    image: NDArray[Any], image_format: ImageFormat, alpha: NDArray[Any] | None = None
) -> tuple[float, float]:
    """Return the shares of the pixels of which any channel is clipped, and of those that are black.

    PNG and JPEG clip values above 1 after the exposure, and show code 0 as black. In EXR and TIFF, which clip nothing,
    values above 1 count, which a screen clips, and pixels without any light.

    Args:
        image: (h, w, 3), linear radiance.
        alpha: (h, w); pixels of which it is 0 do not count as black. None: all do.
    """
    step = max(1, int(np.sqrt(image.shape[0] * image.shape[1] / COUNTED)))
    part = image[::step, ::step].astype(np.float32)
    largest = np.maximum(np.maximum(part[..., 0], part[..., 1]), part[..., 2])  # max(axis=-1) takes ten times as long
    screens = image_format.format in FOR_SCREENS
    factor = 2.0**image_format.exposure if screens else 1.0
    black = largest < CODE_0 / factor if screens else largest == 0
    if alpha is not None:
        black &= alpha[::step, ::step] > 0
    return np.count_nonzero(largest > 1 / factor) / largest.size, np.count_nonzero(black) / largest.size


def mean_shares(shares: Iterable[tuple[float, float]]) -> tuple[float, float] | None:
    """Return the means of the shares of several images; None of none."""
    each = list(shares)
    if not each:
        return None
    clipped, black = (math.fsum(values) / len(each) for values in zip(*each, strict=True))
    return clipped, black


def area_mean(image: Image, width: int, height: int) -> Image:
    """Shrink a linear image: each new pixel is the mean over its area, which may cut pixels.

    Args:
        image: (h, w, 3).
        width, height: pixels, at most the size of the image.

    Returns:
        (height, width, 3) float32.
    """
    rows, columns = _shares(image.shape[0], height), _shares(image.shape[1], width)
    narrow = np.einsum("xw,hwk->hxk", columns, image, optimize=True)
    return np.asarray(np.einsum("yh,hxk->yxk", rows, narrow, optimize=True), np.float32)


def _shares(n: int, m: int) -> Float32:
    """Return the share (m, n) that each of n pixels has in each of m; rows sum to 1."""
    edges = np.arange(m + 1) * (n / m)
    low, high = np.arange(n)[None, :], np.arange(1, n + 1)[None, :]
    overlap = np.minimum(high, edges[1:, None]) - np.maximum(low, edges[:-1, None])
    return np.asarray(np.maximum(overlap, 0) * (m / n), np.float32)


def resized(image: Image | Float32, size: tuple[int, int]) -> Float32:
    """Return an image in another size, (width, height).

    The Blackman-Harris filter has no negative lobes: no dark rings around lamps.

    Args:
        image: (h, w, 3), or (h, w) coverage.
    """
    library, channels = oiio(), image.reshape(*image.shape[:2], -1)
    source = library.ImageBuf(np.ascontiguousarray(channels, np.float32))
    region = library.ROI(0, size[0], 0, size[1], 0, 1, 0, channels.shape[2])
    made = library.ImageBufAlgo.resize(source, "blackman-harris", roi=region).get_pixels(library.FLOAT)
    return np.asarray(made, np.float32).reshape(size[1], size[0], *image.shape[2:])


def link_or_copy(source: Path, target: Path, *, copy: bool = False) -> None:
    """Give the file of an image a second name, or copy it, at request or if the file system cannot link it."""
    if not copy:
        with suppress(OSError, NotImplementedError):  # another disk, FAT, too many links
            target.hardlink_to(os.path.realpath(source))
            return
    shutil.copyfile(source, target)
