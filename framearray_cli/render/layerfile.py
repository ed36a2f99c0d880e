"""The layers of a frame as the channels of an EXR."""

from collections.abc import Mapping

from framearray_cli.array import cryptomatte
from framearray_cli.array.exr import Attribute
from framearray_cli.array.images import COLOUR_ID, DATA, SUN_HOURS
from framearray_cli.base.arrays import Float32
from framearray_cli.engine.images.composed import Layers


def layer_channels(layers: Layers) -> dict[str, Float32]:
    """Return the channels of all layers, name -> (h, w)."""
    channels: dict[str, Float32] = {"depth.Z": layers.depth, "samples": layers.samples}
    several: list[tuple[str, str, Float32 | None]] = [
        ("obscurance", "RGB", layers.obscurance),
        ("indirect", "RGB", layers.indirect),
        ("reflectivity", "RGB", layers.reflectivity),
        ("normal", "XYZ", layers.normal),
    ]
    if layers.marks:
        several += [("position", "XYZ", layers.marks.position), ("uv", "UV", layers.marks.uv)]
    for name, letters, values in several:
        if values is not None:
            channels |= {f"{name}.{letter}": values[..., i] for i, letter in enumerate(letters)}
    channels |= {f"{SUN_HOURS}.{day}": hours for day, hours in layers.sun_hours.items()}
    for kind, matte in layers.marks.mattes.items() if layers.marks else ():
        channels |= cryptomatte.channels_of(cryptomatte.LAYERS[kind], matte.names, matte.number, matte.coverage)
    return channels


def layer_attributes(layers: Layers) -> Mapping[str, Attribute]:
    """Return what the header says of the channels; nothing of those that every array has."""
    if layers.marks is None:
        return {}
    found: dict[str, Attribute] = {COLOUR_ID: DATA}
    for kind, matte in layers.marks.mattes.items():
        found |= cryptomatte.attributes_of(cryptomatte.LAYERS[kind], matte.names)
    return found
