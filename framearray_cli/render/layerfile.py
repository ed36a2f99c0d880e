"""The layers of a frame as the channels of an EXR."""

from collections.abc import Mapping
from typing import Any

from framearray_cli.array import cryptomatte
from framearray_cli.array.exr import Attribute
from framearray_cli.array.images import COLOUR_ID, DATA
from framearray_cli.base.arrays import Float32
from framearray_cli.engine.features.aov import AOVS, Matte

# The names of a layer's components, by layer; of others by their number.
LETTERS = {"depth": "Z", "normal": "XYZ", "position": "XYZ", "uv": "UV"}
BY_NUMBER = {2: "XY", 3: "RGB"}


def layer_channels(layers: Mapping[str, Any]) -> dict[str, Float32]:
    """Return the channels of all layers, name -> (h, w), mattes last."""
    channels: dict[str, Float32] = {}
    for name, values in layers.items():
        if isinstance(values, Matte):
            continue
        if values.ndim == 2:
            channels[f"{name}.{LETTERS[name]}" if name in LETTERS else name] = values
        else:
            letters = LETTERS.get(name, BY_NUMBER[values.shape[-1]])
            channels |= {f"{name}.{letter}": values[..., i] for i, letter in enumerate(letters)}
    for kind, matte in _mattes(layers).items():
        channels |= cryptomatte.channels_of(cryptomatte.LAYERS[kind], matte.names, matte.number, matte.coverage)
    return channels


def layer_attributes(layers: Mapping[str, Any]) -> Mapping[str, Attribute]:
    """Return what the header says of the channels; nothing of those that every array has."""
    if not layers.keys() & AOVS:
        return {}
    found: dict[str, Attribute] = {COLOUR_ID: DATA}
    for kind, matte in _mattes(layers).items():
        found |= cryptomatte.attributes_of(cryptomatte.LAYERS[kind], matte.names)
    return found


def _mattes(layers: Mapping[str, Any]) -> dict[str, Matte]:
    return {kind: matte for kind, matte in layers.items() if isinstance(matte, Matte)}
