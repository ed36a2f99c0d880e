"""The ambient light of an array whose groups of sources are stored separately."""

from dataclasses import replace

import numpy as np

from framearray_cli.engine.terms.ambient.intensity import Ambient
from framearray_cli.scene.paths.paths import Lights, Plane


def image_ambient(ambient: Ambient, lights: Lights) -> Ambient:
    """Return the I_A that images are composed with; with groups, 0 for all planes but that of R W, and 1 there.

    An array with groups has the I_A of each group in its manifest, and adds it when a picture is made.
    """
    if not lights.groups:
        return ambient
    intensity = np.zeros_like(ambient.intensity)
    intensity[lights.planes.index(Plane.INDIRECT)] = 1.0
    return replace(ambient, intensity=intensity)


def name_groups(ambient: Ambient, lights: Lights) -> Ambient:
    """Return the same estimate with the group of the light position in its notes."""
    l = int(ambient.standard_error.argmax())
    group = next((group for group in lights.groups if l in group.positions), None)
    if group is None:
        return ambient
    name = f"at light {l - group.positions.start} of {group.name} "
    return replace(ambient, notes=tuple(note.replace(f"at light {l} ", name) for note in ambient.notes))
