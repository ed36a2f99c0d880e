"""Streams of pictures that the page shows: one kind of picture each, by camera and by light along one axis."""

import re
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from framearray_cli.array.images import FOR_SCREENS, SUN_HOURS, format_name, read_image, require_size
from framearray_cli.array.manifest import Manifest, file_name
from framearray_cli.base.arrays import Float32
from framearray_cli.base.errors import OutputError
from framearray_cli.base.sundays import TOTAL

from .coding import PLAIN_CODING, Coding, coding_for, data_coding

ReadPicture = Callable[[int, int], Float32]  # of a camera, at a light position
ReadLayers = Callable[[Path], dict[str, Float32]]

# Pictures sampled over the array to choose the coding: 3 to 8 ms each, before the page opens.
SAMPLES = 24
LAYER_SAMPLES = 6  # layer files are larger: 20 ms each
# Layers by name in the file: name on the page, channels, and whether exposure applies.
LAYERS = {
    "obscurance": ("Obscurance", "RGB", True),
    "indirect": ("Indirect", "RGB", True),
    "reflectivity": ("Reflectivity", "RGB", True),
    "depth": ("Depth", "Z", False),
    "normal": ("Normals", "XYZ", False),
}
SUN_KEY = "sun-"  # and a day, or the word for all days


@dataclass(frozen=True, slots=True, kw_only=True)
class Stream:
    """Pictures of one kind.

    Attributes:
        key: name of its folder, and in the index.
        role: its part in the picture on the screen.
        label: its name on the page.
        files: pattern of the array's files, relative to its folder; see `file_name`.
        axis: of light positions; "" if the light changes nothing.
        n: indices along the axis; 1 without an axis.
        channels: of a layer, in its file.
        exposed: True if the exposure of the page applies.
        coding: of its values.
    """

    key: str
    role: Literal["image", "group", "ambient", "background", "layer"]
    label: str
    files: str
    axis: str = ""
    n: int = 1
    channels: tuple[str, ...] = ()
    exposed: bool = True
    coding: Coding = PLAIN_CODING


def streams_of(manifest: Manifest) -> list[Stream]:
    """List the streams of images of an array, without codings."""
    if not manifest.groups:
        ((axis, n),) = manifest.axes.items()
        return [Stream(key="light", role="image", label="Picture", files=manifest.images, axis=axis, n=n)]
    found = [
        Stream(
            key=f"g{k}",
            role="group",
            label=group.name,
            files=group.images,
            axis=group.axis,
            n=manifest.axes[group.axis],
        )
        for k, group in enumerate(manifest.groups)
    ]
    if manifest.uses_ambient:
        found.append(Stream(key="ambient", role="ambient", label="Ambient", files=manifest.ambient_images))
    if manifest.background_images:
        found.append(Stream(key="background", role="background", label="Background", files=manifest.background_images))
    return found


def layer_streams(files: str, channels: dict[str, Float32]) -> list[Stream]:
    """List the streams of the layers in a file; hours of sun by day, and in total where there are several days."""
    known = {
        name: (label, tuple(f"{name}.{letter}" for letter in letters) or (name,), exposed)
        for name, (label, letters, exposed) in LAYERS.items()
    }
    suns = [name.partition(".")[2] for name in channels if name.startswith(f"{SUN_HOURS}.")]
    days = [day for day in suns if re.fullmatch(r"[\w-]+", day)]  # a key is part of an address
    for day in days if len(days) > 2 else days[:1]:  # of one day the total is the same
        label = "Hours of sun, all days" if day == TOTAL else f"Hours of sun {day}"
        known[f"{SUN_KEY}{day}"] = (label, (f"{SUN_HOURS}.{day}",), False)
    return [
        Stream(key=key, role="layer", label=label, files=files, channels=own, exposed=exposed)
        for key, (label, own, exposed) in known.items()
        if all(channel in channels for channel in own)
    ]


def read_values(manifest: Manifest, stream: Stream, c: int, l: int, read_layers: ReadLayers) -> Float32:
    """Read a picture: (h, w, 3), or (h, w, 1) for layers of one channel."""
    path = manifest.directory / file_name(stream.files, c, l)
    if names := stream.channels:
        channels = read_layers(path)
        missing = [name for name in names if name not in channels]
        if missing:
            raise OutputError(f"{path}: expected the channels {', '.join(names)}, found no {missing[0]}")
        values = np.stack([channels[name] for name in names], axis=-1)
        if stream.key == "depth" and not stream.coding.scale:
            values = np.where(values > 0, values, stream.coding.high)  # nothing is hit: as far as the coding goes
    else:
        values = read_image(path)
    require_size(path, values.shape, manifest.resolution)
    return values


def largest_value(manifest: Manifest, stream: Stream, read: ReadPicture) -> float:
    """Return the largest value in a sample of those pictures of a stream that exist; 0 if none does or none counts.

    Normals do not count, and neither do images that clip radiance at 1.
    """
    if stream.key == "normal" or (not stream.channels and format_name(stream.files) in FOR_SCREENS):
        return 0.0
    total = manifest.n_cameras * stream.n
    # Steps of the golden ratio: even steps could meet the same few lights again and again.
    count = min(LAYER_SAMPLES if stream.channels else SAMPLES, total)
    found = []
    for number in sorted({int(total * ((k * 0.6180339887498949) % 1)) for k in range(count)}):
        with suppress(OutputError):  # not rendered yet, or damaged; `Tiles.prepare` reports it
            found.append(float(read(*divmod(number, stream.n)).max()))
    return max(found, default=0.0)


def choose_coding(stream: Stream, largest: float) -> Coding:
    """Choose the coding of a stream; images that clip radiance at 1 have a largest value of 0."""
    if stream.key == "normal":
        return Coding(scale=0.0, low=-1.0, high=1.0)
    return coding_for(largest) if stream.exposed else data_coding(largest)
