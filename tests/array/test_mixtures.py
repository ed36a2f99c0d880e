"""Which light changes along the positions that a sum adds up."""

from typing import Any

import pytest

from framearray_cli.array.manifest import ManifestLight
from framearray_cli.array.mixtures import constant_sources, is_constant

PANEL = {"type": "rect", "position": [0.0] * 3, "intensity": [1.0] * 3, "width": 1.0, "two_sided": False}
PANORAMA = {"type": "environment", "file": "sky.exr", "rotation": 0.0, "intensity": [1.0] * 3}
SHINING = {"type": "mesh", "material": "Lamp", "radiance": [1.0] * 3, "two_sided": True}


def lights(*sources: dict[str, Any]) -> tuple[ManifestLight, ...]:
    """One source at each light position."""
    return tuple(ManifestLight(ambient=(0.0,) * 3, ambient_error=(0.0,) * 3, sources=(each,)) for each in sources)


@pytest.mark.parametrize(
    ("source", "change"),
    [
        (PANEL, {"width": 2.0}),
        (PANEL, {"two_sided": True}),
        (PANEL, {"across": [0.0, 0.0, 1.0]}),
        (PANORAMA, {"rotation": 60.0}),
        (PANORAMA, {"intensity": [1.0, 0.5, 0.5]}),
        (SHINING, {"radiance": [0.0] * 3}),
    ],
)
def test_a_source_that_changes_is_not_constant(source: dict[str, Any], change: dict[str, Any]) -> None:
    assert constant_sources(lights(*[source] * 6)) == [0]
    assert is_constant(lights(*[source] * 6))
    changed = lights(*[source, source | change] * 3)
    assert constant_sources(changed) == []
    assert not is_constant(changed)
