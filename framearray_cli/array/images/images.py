"""Read and write one image.

EXR and TIFF go through OpenImageIO, but for EXR without compression, which `plain_exr.py` encodes. OpenImageIO reports
success for a PNG on a full disk and reads half a JPEG without an error, so PNG and JPEG go through Pillow, in memory.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Bytes, Float32, Image
from framearray_cli.base.colour import linear_from_srgb8, srgb8_from_linear
from framearray_cli.base.errors import MissingExtraError
from framearray_cli.base.extras import install_command
from framearray_cli.base.files import write_bytes
from framearray_cli.base.openimage import oiio, read_pixels, read_rgb, write_pixels
from framearray_cli.base.units import counted

from . import plain_exr
from .alpha import premultiplied, unassociated_codes
from .attributes import Attributes
from .cryptomatte import PREFIX
from .exr import OIIO_NAMES, spec_of
from .png import can_encode, encode_jpeg, encode_png, read_codes

Extension = Literal["exr", "png", "tif", "jpg"]

HALF_MAX = 65504.0  # the largest half; values beyond become infinite
EXR_COMPRESSIONS = ("none", "rle", "zips", "zip", "piz", "pxr24", "b44", "b44a", "dwaa", "dwab")
SUN_HOURS = "sun_hours"  # layer with a channel per day of a sun study, and one for all days
# Layers that need more than the 11 bits of a half.
FLOAT_LAYERS = ("depth", "samples", SUN_HOURS, "position", "uv", PREFIX)
COLOUR_ID, SCENE_LIGHT, DATA = "colorInteropID", "lin_rec709_scene", "data"  # what EXR says of its channels
FOR_SCREENS = ("png", "jpg")  # formats of 8-bit sRGB; the others keep the radiance
_SAME = {"jpeg": "jpg", "tiff": "tif"}


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageFormat:
    """Format of image files and its options.

    Attributes:
        format: exr and tif keep linear radiance; png and jpg are sRGB, 8 bits, clipped to [0, 1].
        compression: of EXR; one of EXR_COMPRESSIONS, optionally with a level: "zip:1" (the default of "zip") to
            "zip:9", "dwaa:45".
        half: how EXR stores values: "auto" as half, or as float in an image with values beyond 65504; "always" as
            half, such values clamped to 65504; "never" as float. TIFF is always float.
        quality: of JPEG, 1 to 100.
        exposure: stops added to what png and jpg show; exr and tif keep the radiance as it is.
    """

    format: Extension = "exr"
    compression: str = "none"
    half: Literal["auto", "always", "never"] = "auto"
    quality: int = 95
    exposure: float = 0.0

    @property
    def composes_halves(self) -> bool:
        """Whether `write_image` accepts halves; with "auto" only images without values beyond 65504."""
        return self.format == "exr" and self.half != "never"

    def __post_init__(self) -> None:
        _compression(self.compression)
        if self.half not in ("auto", "always", "never"):
            raise ValueError(f"expected auto, always or never, got {self.half!r}")
        if self.format not in ("exr", "png", "tif", "jpg"):
            raise ValueError(f"expected exr, png, tif or jpg, got {self.format!r}")
        if not 1 <= self.quality <= 100:
            raise ValueError(f"expected a quality from 1 to 100, got {self.quality}")


def format_name(path: Path | str) -> str:
    """Return the format of a file's suffix in its usual spelling: "png", "jpg"; "" without a suffix."""
    suffix = Path(path).suffix.lower()[1:]
    return _SAME.get(suffix, suffix)


def require_writer(name: Extension) -> None:
    """Check, before any work is done, that a format can be written here: libraries may be built without it.

    Raises:
        MissingExtraError: it cannot.
    """
    if name in OIIO_NAMES:
        good, library = oiio().ImageOutput.create(OIIO_NAMES[name]) is not None, "OpenImageIO"
        oiio().geterror()  # clears what a failed attempt left behind
    else:
        good, library = can_encode(name), "Pillow"
    if not good:
        raise MissingExtraError(
            f"{library} is built without {name.upper()} here; choose another format, or install a build that has it "
            f"with: {install_command(f'--force-reinstall {library}')}"
        )


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
        ValueError: the image holds NaN or infinity, or has another shape.
        OutputError: the file cannot be written.
    """
    if image.ndim != 3 or image.shape[2] != 3:
        raise ValueError(f"{path}: expected an image of shape (h, w, 3), got {image.shape}")
    attributes = attributes or {}
    if image.dtype == np.float16:
        _write_exr(path, image, more or {}, image_format, attributes, alpha)
        return
    image = np.asarray(image, np.float32)
    largest = _largest(str(path), image)
    if image_format.format in FOR_SCREENS:
        exposed = image * np.float32(2.0**image_format.exposure) if image_format.exposure else image
        codes = srgb8_from_linear(exposed) if alpha is None else unassociated_codes(exposed, alpha)
        write_codes(path, codes, image_format, attributes)
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
        spec.attribute(
            "tiff:write_exif", 0
        )  # else OpenImageIO fails to write an empty Exif directory and reports an error
        write_pixels(path, "tiff", spec, image)


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
    if image_format.compression == "none" and plain_exr.can_encode(attributes):
        write_bytes(path, plain_exr.encode_plain_exr(pixels, names, attributes))
        return
    spec = spec_of(pixels.shape, names, [kind] * len(names), attributes)
    spec.attribute("compression", _compression(image_format.compression))
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


def write_layers(
    path: Path, layers: Mapping[str, Float32], attributes: Attributes | None = None, compression: str = "zip"
) -> None:
    """Write a multi-channel EXR, whole or not at all.

    Names follow OpenEXR's `layer.channel`: "obscurance.R", "normal.X", "depth.Z"; "samples" is a channel without a
    layer. Layers named in FLOAT_LAYERS, and channels with values beyond 65504, are stored as float, others as half.

    Args:
        path: the file.
        layers: channel name -> (h, w), finite; all of one shape, at least one.
        attributes: as in `write_image`.
        compression: as in `ImageFormat`.

    Raises:
        ValueError: a value is not finite, or shapes differ.
        OutputError: the file cannot be written.
    """
    shapes = {layer.shape for layer in layers.values()}
    if len(shapes) != 1 or len(next(iter(shapes))) != 2:
        raise ValueError(f"{path}: expected channels of one shape (h, w), got {sorted(shapes)}")
    kinds = [
        "float" if _largest(f"{path}: {name}", layer) > HALF_MAX or name.startswith(FLOAT_LAYERS) else "half"
        for name, layer in layers.items()
    ]
    pixels = np.stack([np.asarray(layer, np.float32) for layer in layers.values()], axis=-1)
    spec = spec_of(pixels.shape, list(layers), kinds, attributes or {})
    spec.attribute("compression", _compression(compression))
    write_pixels(path, "openexr", spec, pixels)


def read_image(path: Path) -> Image:
    """Read an image as linear radiance: (h, w, 3) float32; PNG and JPEG are decoded from sRGB.

    An image with alpha is as before black: premultiplied. `read_alpha` in `alpha.py` reads its alpha.

    Raises:
        OutputError: the file is missing, damaged or truncated, or has no channels R, G, B.
    """
    if format_name(path) in FOR_SCREENS:
        codes = read_codes(path)
        return linear_from_srgb8(codes) if codes.shape[-1] == len("RGB") else premultiplied(codes)
    return read_rgb(path)


def read_layers(path: Path) -> dict[str, Float32]:
    """Read every channel of an EXR: name -> (h, w) float32, in the order of the file (by name).

    Raises:
        OutputError: the file is missing, damaged or truncated.
    """
    names, pixels = read_pixels(path)
    return {name: np.ascontiguousarray(pixels[..., i]) for i, name in enumerate(names)}


def _compression(name_and_level: str) -> str:
    """Check the name of an EXR compression and fill in its level; OpenImageIO takes any unknown name for zip.

    Noise hardly compresses: level 1 takes 6 ms for 400x300, level 4 (zip's own default) 10 ms and saves 7 %.
    """
    name, _, level = name_and_level.partition(":")
    if name not in EXR_COMPRESSIONS or (":" in name_and_level and not level.isdigit()):
        raise ValueError(f"expected one of {', '.join(EXR_COMPRESSIONS)}, got {name_and_level!r}")
    return f"{name}:1" if name in ("zip", "zips") and not level else name_and_level


def _largest(label: str, values: Float32) -> float:
    """Return the largest magnitude, and refuse NaN and infinity, which min and max pass on."""
    low, high = float(values.min()), float(values.max())
    if not (math.isfinite(low) and math.isfinite(high)):
        raise ValueError(f"{label}: not finite, {counted(int(np.count_nonzero(~np.isfinite(values))), 'value')}")
    return max(-low, high)
