"""EXR: names of attributes, camera matrices, and files that need no library.

Notation: matrices here act on columns, `camera_from_world @ point`. OpenEXR (Imath) multiplies rows from the left,
`point * M44f`, so files store each matrix transposed.
"""

import struct
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Float64
from framearray_cli.base.lens import ORTHOGRAPHIC, PANORAMA, PERSPECTIVE, Lens
from framearray_cli.base.openimage import FIXED_DATE, oiio
from framearray_cli.base.units import frame_rate

# A (4, 4) array is a matrix that acts on columns; three floats are a point or a colour; a Fraction is a rational.
Attribute: TypeAlias = str | int | float | Fraction | tuple[float, float, float] | Float64
Attributes: TypeAlias = Mapping[str, Attribute]
_MAGIC, _VERSION, _LONG_NAMES = 20000630, 2, 0x400
_SHORT_NAME = 31  # bytes; longer names need a flag
_HALF, _FLOAT = 1, 2  # OpenEXR's types of pixels
_COMPRESSIONS = {"none": 0, "dwaa": 8, "dwab": 9}  # OpenEXR's numbers
_ALIGNED = 8  # rows start at a multiple of this in memory
# Names that OpenImageIO stores as they are; others it may rename, or keep to itself.
_PLAIN_NAMES = {"Software", "worldToCamera", "worldToNDC", "framesPerSecond", "colorInteropID", "PixelAspectRatio"}
_OWN = "framearray:"


def exr_camera_from_world(world_from_camera: Float64) -> Float64:
    """Return OpenEXR's worldToCamera: x right, y up, z along the view (left-handed, as in RenderMan).

    Args:
        world_from_camera: (4, 4) rigid; the camera looks along -z, y up.

    Returns:
        (4, 4), acts on columns.
    """
    turned = np.linalg.inv(np.asarray(world_from_camera, np.float64))
    turned[2] *= -1  # ours looks along -z
    return turned


def exr_ndc_from_world(world_from_camera: Float64, lens: Lens, width: int, height: int) -> Float64:
    """Return OpenEXR's worldToNDC: after division by w, (0, 0) is the upper left corner, (1, 1) the lower right.

    z / w is 1 - 1 / distance along the view, and of an orthographic camera the distance: the standard leaves z open,
    and this keeps the matrix invertible.

    Args:
        world_from_camera: (4, 4) rigid; the camera looks along -z, y up.
        lens: no panorama.
        width: pixels.
        height: pixels.

    Returns:
        (4, 4), acts on columns.
    """
    high = lens.height if lens.type == ORTHOGRAPHIC else 2 * np.tan(np.radians(lens.fov) / 2)
    half_height = high / 2  # of what is seen at distance 1
    half_width = half_height * width / height * lens.pixel_aspect
    across, down = 0.5 / half_width, -0.5 / half_height
    left, top = (at / side for at, side in zip(lens.centre((width, height)), (width, height), strict=True))
    if lens.type == ORTHOGRAPHIC:
        ndc_from_camera = np.array([[across, 0, 0, left], [0, down, 0, top], [0, 0, 1, 0], [0, 0, 0, 1]])
    else:
        ndc_from_camera = np.array([[across, 0, left, 0], [0, down, top, 0], [0, 0, 1, -1], [0, 0, 1, 0]])
    return np.asarray(ndc_from_camera @ exr_camera_from_world(world_from_camera))


def _lens_attributes(lens: Lens) -> dict[str, Attribute]:
    if lens.type == PERSPECTIVE:
        found: dict[str, Attribute] = {"framearray:fov": float(lens.fov)}
    else:
        found = {"framearray:type": lens.type}
    found |= {"framearray:height": float(lens.height)} if lens.type == ORTHOGRAPHIC else {}
    if lens.shift != (0.0, 0.0):
        found |= {"framearray:shift_x": lens.shift[0], "framearray:shift_y": lens.shift[1]}
    return found | ({"PixelAspectRatio": lens.pixel_aspect} if lens.pixel_aspect != 1.0 else {})


def frame_attributes(
    *,
    world_from_camera: Float64,
    lens: Lens,
    resolution: tuple[int, int],
    fps: float | Fraction,
    c: int,
    l: int | None = None,
    group: str = "",
    software: str = "framearray",
) -> dict[str, Attribute]:
    """Return the attributes of the file of image [c, l], or of camera c where `l` is None.

    Args:
        world_from_camera: (4, 4), in the scene file's own coordinates; the camera looks along -z, y up.
        lens: of the camera; a panorama gets no worldToNDC, as no matrix projects like it.
        resolution: (width, height), pixels.
        fps: frames per second.
        c: camera index.
        l: light index.
        group: whose light the file holds, or the name of another stored part; "": all light.
        software: program and version.
    """
    attributes: dict[str, Attribute] = {
        "Software": software,
        "worldToCamera": exr_camera_from_world(world_from_camera),
        **({} if lens.type == PANORAMA else {"worldToNDC": exr_ndc_from_world(world_from_camera, lens, *resolution)}),
        "framesPerSecond": frame_rate(fps),
        "framearray:camera": c,
        **_lens_attributes(lens),
    }
    if l is not None:
        attributes["framearray:light"] = l
    if group:
        attributes["framearray:group"] = group
    return attributes


def spec_of(shape: tuple[int, ...], names: list[str], kinds: list[str], attributes: Attributes) -> Any:
    """Describe an image of `shape` (h, w, channels) with "half" or "float" per channel."""
    library = oiio()
    height, width, channels = shape
    spec = library.ImageSpec(width, height, channels, "float" if "float" in kinds else "half")
    spec.channelnames = names
    if len(set(kinds)) > 1:
        spec.channelformats = kinds
    for name, value in {"DateTime": FIXED_DATE, **attributes}.items():
        if isinstance(value, np.ndarray):
            rows = np.asarray(value.T, np.float32)  # row vectors in the file
            spec.attribute(name, library.TypeDesc("matrix44"), tuple(rows.ravel().tolist()))
        elif isinstance(value, Fraction):
            spec.attribute(name, library.TypeDesc("rational"), (value.numerator, value.denominator))
        elif isinstance(value, tuple):
            spec.attribute(name, library.TypeDesc("vector"), tuple(float(x) for x in value))
        else:
            spec.attribute(name, value)
    return spec


def is_plain(attributes: Attributes) -> bool:
    """Return True if the encoders here know all attributes."""
    return all(name in _PLAIN_NAMES or name.startswith(_OWN) for name in attributes)


def encode_plain_exr(pixels: NDArray[Any], names: list[str], attributes: Attributes) -> memoryview:
    """Encode pixels (h, w, channels), halves or float32, as a file of EXR that is not compressed.

    Args:
        names: of the channels.
        attributes: for which `is_plain`.
    """
    height, width, _ = pixels.shape
    kind, word = (_HALF, np.dtype("<u2")) if pixels.dtype == np.float16 else (_FLOAT, np.dtype("<u4"))
    head = _header(width, height, kind, sorted(names), attributes)
    row_bytes = len(names) * width * word.itemsize
    step, first = 8 + row_bytes, len(head) + 8 * height
    before = -first % _ALIGNED
    data = np.empty(before + first + height * step, np.uint8)
    data[before : before + len(head)] = np.frombuffer(head, np.uint8)
    offsets = (first + step * np.arange(height)).astype("<u8")
    data[before + len(head) : before + first] = offsets.view(np.uint8)
    # a row: its number, its size, and each channel's values, channels by name
    rows = data[before + first :].reshape(height, step)
    rows[:, :4] = np.arange(height, dtype="<i4").view(np.uint8).reshape(height, 4)
    rows[:, 4:8] = np.frombuffer(struct.pack("<i", row_bytes), np.uint8)
    values, source = rows[:, 8:].view(word), pixels.view(word.newbyteorder("="))
    for k, channel in enumerate(sorted(range(len(names)), key=names.__getitem__)):
        values[:, k * width : (k + 1) * width] = source[..., channel]
    return data[before:].data


def encode_chunked_exr(
    chunks: Sequence[bytes],
    lines: int,
    size: tuple[int, int],
    names: list[str],
    attributes: Attributes,
    compression: str,
) -> bytes:
    """Join compressed chunks of halves, of that many scan lines each, to a file of EXR.

    Args:
        size: width and height.
        names: of the channels.
        attributes: for which `is_plain`.
        compression: "dwaa" or "dwab".
    """
    head = _header(*size, _HALF, sorted(names), attributes, compression)
    ends = np.cumsum([len(head) + 8 * len(chunks), *(8 + len(chunk) for chunk in chunks)])
    parts = [part for k, chunk in enumerate(chunks) for part in (struct.pack("<ii", lines * k, len(chunk)), chunk)]
    return b"".join([head, ends[:-1].astype("<u8").tobytes(), *parts])


def _header(
    width: int, height: int, kind: int, names: list[str], attributes: Attributes, compression: str = "none"
) -> bytes:
    """Encode the header; attributes stand in the order of their names."""
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    channels = b"".join(name.encode() + b"\0" + struct.pack("<iB3xii", kind, 0, 1, 1) for name in names) + b"\0"
    entries = {
        "capDate": ("string", FIXED_DATE.encode()),
        "channels": ("chlist", channels),
        "compression": ("compression", bytes([_COMPRESSIONS[compression]])),
        "dataWindow": ("box2i", window),
        "displayWindow": ("box2i", window),
        "lineOrder": ("lineOrder", b"\0"),
        "pixelAspectRatio": ("float", struct.pack("<f", 1)),
        "screenWindowCenter": ("v2f", struct.pack("<2f", 0, 0)),
        "screenWindowWidth": ("float", struct.pack("<f", 1)),
        **{
            "pixelAspectRatio" if name == "PixelAspectRatio" else name: _encode_attribute(value)
            for name, value in attributes.items()
            if not isinstance(value, str) or value
        },
    }
    longest = max(len(name.encode()) for name in (*entries, *names))
    parts = [struct.pack("<ii", _MAGIC, _VERSION | (_LONG_NAMES if longest > _SHORT_NAME else 0))]
    for name in sorted(entries, key=str.encode):
        type_name, value = entries[name]
        parts.append(name.encode() + b"\0" + type_name.encode() + b"\0" + struct.pack("<i", len(value)) + value)
    return b"".join(parts) + b"\0"


def _encode_attribute(value: Attribute) -> tuple[str, bytes]:
    """OpenEXR's type of an attribute, and its bytes."""
    if isinstance(value, np.ndarray):
        return "m44f", np.ascontiguousarray(value.T, "<f4").tobytes()  # row vectors in the file
    if isinstance(value, Fraction):
        return "rational", struct.pack("<iI", value.numerator, value.denominator)
    if isinstance(value, str):
        return "string", value.encode()
    if isinstance(value, tuple):
        return "v3f", struct.pack("<3f", *value)
    return ("int", struct.pack("<i", value)) if isinstance(value, int) else ("float", struct.pack("<f", value))
