"""Materials of the scene file that emit light -> sources of a first job."""

import numpy as np

from framearray_cli.engine.inputs.emitters import brightness
from framearray_cli.scene.scene import Scene

from .model import MeshLight

MOST = 8  # sources; each costs a shadow ray per hit
LEAST = 0.01  # of the power of the strongest: fainter ones are left out


class AllNames:
    """Every name."""

    def __contains__(self, name: object) -> bool:
        return True


def mesh_lights(scene: Scene) -> tuple[tuple[MeshLight, ...], tuple[str, ...]]:
    """Find the materials that emit most; also return a note on those that are left out, if any."""
    power: dict[str, float] = {}
    sides: dict[str, bool] = {}
    corners = scene.corners.astype(np.float64)
    for m, name in enumerate(scene.material_names):
        rows = np.flatnonzero(scene.material == m).astype(np.int32)
        if not len(rows) or not scene.emission[m].any():
            continue
        a, b = corners[rows, 1] - corners[rows, 0], corners[rows, 2] - corners[rows, 0]
        area = np.linalg.norm(np.cross(a, b), axis=1) / 2
        bright = brightness(scene, rows, np.full(len(rows), scene.emission_texture[m]))
        sides[name] = not scene.one_sided[m]
        power[name] = power.get(name, 0.0) + float((area * bright).sum() * scene.emission[m].mean())
    names = sorted(power, key=lambda name: -power[name])
    kept = [name for name in names[:MOST] if power[name] >= LEAST * power[names[0]]]
    left = [name for name in power if name not in kept]
    notes = (f"the emission of faint materials is left out: {', '.join(left[:MOST])}",) if left else ()
    lights = tuple(
        MeshLight(
            material=name,
            intensity=1.0,
            two_sided=sides[name],
            about=(f'the material "{name}" shines, as the file says',),
            name=name,
        )
        for name in kept
    )
    return lights, notes
