"""Layers of a camera position: channels of a file put together by name."""

import numpy as np
from numpy.typing import NDArray

from framearray_cli.array.images import read_layers
from framearray_cli.array.manifest import Manifest, layers_path

# Components of a layer in their order; a layer with others, such as the days of `sun_hours`, stays in parts.
_COMPONENTS = ("RGBA", "RGB", "XYZ", "UV", "XY")


def read_stacked(manifest: Manifest, c: int) -> dict[str, NDArray[np.float32]]:
    """Read the layers of camera c: name -> (h, w, components), or (h, w) where there is one; in the order of the file.

    Raises:
        OutputError: the array has no layers, or the file is missing or damaged.
    """
    channels = read_layers(layers_path(manifest, c))
    names: dict[str, list[str]] = {}
    for channel in channels:
        name, _, component = channel.rpartition(".")
        names.setdefault(name, []).append(component)
    found: dict[str, NDArray[np.float32]] = {}
    for name, components in names.items():
        order = next((known for known in _COMPONENTS if set(known) == set(components)), None)
        if not name:
            found |= {component: channels[component] for component in components}
        elif order is not None:
            found[name] = np.stack([channels[f"{name}.{component}"] for component in order], axis=-1)
        elif components == ["Z"]:  # depth
            found[name] = channels[f"{name}.Z"]
        else:
            found |= {f"{name}.{component}": channels[f"{name}.{component}"] for component in components}
    return found
