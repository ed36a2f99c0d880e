"""Materials of the staircase: linear reflectivities, mostly 0.2 to 0.8."""

from ..common import textures as tex
from ..common.glb import Material


def materials() -> dict[str, Material]:
    """Linear reflectivities, mostly 0.2 to 0.8."""
    white = (1.0, 1.0, 1.0)
    return {
        "FloorMarble": Material(
            colour=white,
            metres=1.6,
            texture=tex.marble((0.74, 0.70, 0.63), (0.45, 0.41, 0.37), 1, 768, (0.33, 0.26, 0.22)),
        ),
        "Marble": Material(colour=white, metres=1.7, texture=tex.marble((0.73, 0.69, 0.62), (0.50, 0.46, 0.41), 2)),
        "MarbleRose": Material(colour=white, metres=1.3, texture=tex.marble((0.64, 0.42, 0.34), (0.76, 0.64, 0.56), 3)),
        "Plaster": Material(colour=(0.80, 0.76, 0.67)),
        "WallSilk": Material(colour=white, metres=0.5, texture=tex.cloth((0.76, 0.66, 0.50), 4, 256, 32, 0.2)),
        "Ceiling": Material(colour=(0.82, 0.79, 0.72)),
        "CofferBlue": Material(colour=(0.44, 0.57, 0.68)),
        "Runner": Material(
            colour=white, texture=tex.lozenges((0.52, 0.05, 0.06), (0.70, 0.52, 0.24), (0.22, 0.03, 0.06), 5)
        ),
        "Velvet": Material(colour=(0.44, 0.05, 0.07)),
        "Mahogany": Material(
            colour=white, metres=1.4, texture=tex.wood((0.30, 0.13, 0.07), (0.16, 0.06, 0.035), 6, 256, 1)
        ),
        "RailWood": Material(colour=(0.26, 0.11, 0.06)),
        "Gilding": Material(colour=(0.74, 0.50, 0.18)),
        "Brass": Material(colour=(0.64, 0.46, 0.20)),
        "WindowPaint": Material(colour=(0.74, 0.71, 0.63)),
        "Globe": Material(colour=(0.86, 0.83, 0.76)),
        "Candle": Material(colour=(0.80, 0.76, 0.64)),
        "Crystal": Material(colour=(0.80, 0.84, 0.88), mirror=True),
        "Mirror": Material(colour=(0.86, 0.88, 0.87), mirror=True),
        "Leaf": Material(colour=(0.18, 0.34, 0.09)),
        "LeafDark": Material(colour=(0.09, 0.22, 0.07)),
        "Opera": Material(
            colour=white,
            texture=tex.landscape(7, (0.60, 0.46, 0.30), [(0.26, 0.22, 0.26), (0.20, 0.16, 0.10), (0.30, 0.16, 0.08)]),
        ),
        "Ballet": Material(
            colour=white,
            texture=tex.landscape(8, (0.42, 0.52, 0.60), [(0.30, 0.30, 0.38), (0.22, 0.28, 0.14), (0.36, 0.28, 0.12)]),
        ),
        "Facade": Material(colour=(0.52, 0.45, 0.36)),
        "Roof": Material(colour=(0.16, 0.15, 0.16)),
        "Street": Material(
            colour=white, metres=4.0, texture=tex.leaves([(0.22, 0.22, 0.22), (0.30, 0.29, 0.27)], 9, 256)
        ),
    }
