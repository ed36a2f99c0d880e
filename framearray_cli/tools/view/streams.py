"""Streams of pictures that the page shows: one kind of picture each, by camera and by light along one axis."""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from framearray_cli.array.images import FOR_SCREENS, SUN_HOURS, format_name, read_image, require_size
from framearray_cli.array.manifest import Manifest, ManifestGroup, file_name
from framearray_cli.base.arrays import Float32, Image
from framearray_cli.base.errors import OutputError
from framearray_cli.base.sundays import TOTAL

from .coding import PLAIN_CODING, Coding, coding_for, data_coding

Role = Literal["image", "group", "ambient", "background", "layer"]
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
    "samples": ("Samples", "", False),
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
        axis: of light positions; "" if the light changes nothing.
        n: indices along the axis; 1 without an axis.
        group: of sources, only for the role "group".
        coding: of its values.
    """

    key: str
    role: Role
    label: str
    axis: str = ""
    n: int = 1
    group: ManifestGroup | None = None
    coding: Coding = PLAIN_CODING


def streams_of(manifest: Manifest) -> list[Stream]:
    """List the streams of images of an array, without codings."""
    axes = manifest.axes
    found = []
    if manifest.groups:
        for k, group in enumerate(manifest.groups):
            n = axes[group.axis]
            found.append(Stream(key=f"g{k}", role="group", label=group.name, axis=group.axis, n=n, group=group))
        if manifest.uses_ambient:
            found.append(Stream(key="ambient", role="ambient", label="Ambient"))
        if manifest.background_images:
            found.append(Stream(key="background", role="background", label="Background"))
    else:
        ((axis, n),) = axes.items()
        found.append(Stream(key="light", role="image", label="Picture", axis=axis, n=n))
    return found


def layer_streams(channels: dict[str, Float32]) -> list[Stream]:
    """List the streams of the layers in a file; hours of sun by day, and in total where there are several days."""
    known = [
        Stream(key=name, role="layer", label=label)
        for name, (label, letters, _) in LAYERS.items()
        if all(channel in channels for channel in _channels(name, letters))
    ]
    suns = [name.partition(".")[2] for name in channels if name.startswith(f"{SUN_HOURS}.")]
    days = [day for day in suns if re.fullmatch(r"[\w-]+", day)]  # a key is part of an address
    shown = days if len(days) > 2 else days[:1]  # of one day the total is the same
    labels = {day: "Hours of sun, all days" if day == TOTAL else f"Hours of sun {day}" for day in shown}
    return known + [Stream(key=f"{SUN_KEY}{day}", role="layer", label=label) for day, label in labels.items()]


def is_exposed(stream: Stream) -> bool:
    """Return whether the exposure of the page applies."""
    return stream.role != "layer" or LAYERS.get(stream.key, ("", "", False))[2]


def _layer_channels(key: str) -> list[str]:
    """Return the channels of a layer in its file."""
    if key.startswith(SUN_KEY):
        return [f"{SUN_HOURS}.{key.removeprefix(SUN_KEY)}"]
    return _channels(key, LAYERS[key][1])


def source_name(manifest: Manifest, stream: Stream, c: int, l: int) -> str:
    """Return the array's file of a picture, relative to its folder."""
    patterns = {
        "image": manifest.images,
        "group": stream.group.images if stream.group else "",
        "layer": manifest.layers,
        "ambient": manifest.ambient_images,
        "background": manifest.background_images,
    }
    return file_name(patterns[stream.role], c, l)


def source_file(manifest: Manifest, stream: Stream, c: int, l: int) -> Path:
    """Return the array's file of a picture."""
    return manifest.directory / source_name(manifest, stream, c, l)


def read_values(manifest: Manifest, stream: Stream, c: int, l: int, read_layers: ReadLayers) -> Float32:
    """Read a picture: (h, w, 3), or (h, w, 1) for layers of one channel.

    Raises:
        OutputError: the file is missing, damaged, or of another size.
    """
    path = source_file(manifest, stream, c, l)
    if stream.role == "layer":
        channels = read_layers(path)
        names = _layer_channels(stream.key)
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
    """Return the largest value in a sample of those pictures of a stream that exist; 0 if none does or none counts."""
    if _is_normal(stream) or is_clipped(manifest, stream):
        return 0.0
    return max((float(values.max()) for values in _sample_values(manifest, stream, read)), default=0.0)


def choose_coding(stream: Stream, largest: float) -> Coding:
    """Choose the coding of a stream; images that clip radiance at 1 have a largest value of 0."""
    if _is_normal(stream):
        return Coding(scale=0.0, low=-1.0, high=1.0)
    return coding_for(largest) if is_exposed(stream) else data_coding(largest)


def _is_normal(stream: Stream) -> bool:
    return stream.key == "normal" and stream.role == "layer"


def _sample_values(manifest: Manifest, stream: Stream, read: ReadPicture) -> Iterator[Image]:
    """Read a few pictures of a stream, spread over cameras and lights."""
    total = manifest.n_cameras * stream.n
    # Steps of the golden ratio: even steps could meet the same few lights again and again.
    count = LAYER_SAMPLES if stream.role == "layer" else SAMPLES
    numbers = {int(total * ((k * 0.6180339887498949) % 1)) for k in range(min(count, total))}
    for number in sorted(numbers):
        try:
            yield read(*divmod(number, stream.n))
        except OutputError:  # not rendered yet, or damaged; `Tiles.prepare` reports it
            continue


def is_clipped(manifest: Manifest, stream: Stream) -> bool:
    """Return whether the array's images clip radiance at 1."""
    return stream.role != "layer" and format_name(source_file(manifest, stream, 0, 0)) in FOR_SCREENS


def _channels(name: str, letters: str) -> list[str]:
    return [f"{name}.{letter}" for letter in letters] or [name]
