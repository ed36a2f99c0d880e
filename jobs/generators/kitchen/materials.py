"""Materials of the kitchen: linear reflectivities, mostly 0.2 to 0.8."""

from ..common import textures as tex
from ..common.glb import Material


def materials() -> dict[str, Material]:
    """Linear reflectivities, mostly 0.2 to 0.8."""
    white = (1.0, 1.0, 1.0)
    return {
        "WallPaint": Material(colour=(0.80, 0.76, 0.67)),
        "Ceiling": Material(colour=(0.84, 0.83, 0.79)),
        "Plaster": Material(colour=(0.78, 0.75, 0.68)),
        "FloorTiles": Material(
            colour=white,
            metres=1.6,
            texture=tex.tiles([(0.48, 0.27, 0.17), (0.60, 0.50, 0.37)], (0.30, 0.26, 0.21), 1, 768, 4, 0.035, 0.09),
        ),
        "WallTiles": Material(
            colour=white,
            metres=0.6,
            texture=tex.tiles([(0.78, 0.79, 0.76), (0.72, 0.76, 0.75)], (0.5, 0.44, 0.41), 2, 512, 6, 0.05, 0.04),
        ),
        "Cabinet": Material(colour=(0.38, 0.52, 0.44)),
        "Dresser": Material(colour=(0.22, 0.36, 0.46)),
        "Cream": Material(colour=(0.76, 0.70, 0.57)),
        "WindowPaint": Material(colour=(0.80, 0.79, 0.75)),
        "Worktop": Material(
            colour=white, metres=1.3, texture=tex.wood((0.62, 0.43, 0.25), (0.40, 0.24, 0.12), 3, planks=8)
        ),
        "TableTop": Material(
            colour=white, metres=1.1, texture=tex.wood((0.60, 0.41, 0.23), (0.38, 0.22, 0.10), 4, planks=6)
        ),
        "Oak": Material(colour=white, metres=1.2, texture=tex.wood((0.48, 0.31, 0.17), (0.27, 0.15, 0.07), 5, 256, 1)),
        "Walnut": Material(colour=(0.24, 0.12, 0.06)),
        "Beam": Material(colour=white, metres=1.5, texture=tex.wood((0.44, 0.31, 0.19), (0.26, 0.17, 0.09), 6, 256, 1)),
        "Plinth": Material(colour=(0.14, 0.15, 0.14)),
        "Brass": Material(colour=(0.60, 0.42, 0.18)),
        "Iron": Material(colour=(0.09, 0.09, 0.095)),
        "Enamel": Material(colour=(0.68, 0.66, 0.58)),
        "Pastel": Material(colour=(0.62, 0.30, 0.22)),
        "Porcelain": Material(colour=(0.80, 0.80, 0.78)),
        "Glaze": Material(colour=(0.24, 0.42, 0.52)),
        "GlazeGreen": Material(colour=(0.36, 0.48, 0.30)),
        "Terracotta": Material(colour=(0.52, 0.24, 0.14)),
        "Wicker": Material(colour=(0.50, 0.35, 0.19)),
        "Gingham": Material(
            colour=white,
            metres=0.16,
            texture=tex.tiles([(0.60, 0.16, 0.12), (0.72, 0.62, 0.54)], (0.66, 0.40, 0.33), 7, 256, 4, 0.0, 0.03),
        ),
        "Linen": Material(colour=white, metres=0.12, texture=tex.cloth((0.74, 0.68, 0.57), 8)),
        "RugWool": Material(
            colour=white,
            metres=1.1,
            texture=tex.lozenges((0.42, 0.16, 0.13), (0.70, 0.60, 0.44), (0.16, 0.20, 0.30), 9),
        ),
        "Meadow": Material(
            colour=white,
            texture=tex.landscape(10, (0.50, 0.62, 0.74), [(0.28, 0.36, 0.38), (0.28, 0.38, 0.18), (0.50, 0.46, 0.16)]),
        ),
        "Dusk": Material(
            colour=white, texture=tex.landscape(11, (0.72, 0.50, 0.34), [(0.30, 0.26, 0.34), (0.18, 0.20, 0.22)])
        ),
        "Flour": Material(colour=(0.76, 0.72, 0.62)),
        "Lentils": Material(colour=(0.55, 0.25, 0.10)),
        "Peas": Material(colour=(0.34, 0.40, 0.14)),
        "Coffee": Material(colour=(0.16, 0.09, 0.05)),
        "Oil": Material(colour=(0.42, 0.40, 0.08)),
        "Vinegar": Material(colour=(0.32, 0.07, 0.05)),
        "Apple": Material(colour=(0.58, 0.09, 0.06)),
        "Lemon": Material(colour=(0.74, 0.58, 0.08)),
        "Orange": Material(colour=(0.76, 0.32, 0.04)),
        "Lime": Material(colour=(0.34, 0.50, 0.08)),
        "Crust": Material(colour=(0.48, 0.26, 0.10)),
        "Crumb": Material(colour=(0.68, 0.52, 0.32)),
        "Leaf": Material(colour=(0.20, 0.38, 0.10)),
        "LeafDark": Material(colour=(0.10, 0.26, 0.09)),
        "Stem": Material(colour=(0.22, 0.33, 0.12)),
        "Tulip": Material(colour=(0.72, 0.14, 0.12)),
        "TulipPale": Material(colour=(0.78, 0.52, 0.22)),
        "Garden": Material(
            colour=white,
            metres=6.0,
            texture=tex.leaves([(0.12, 0.22, 0.05), (0.20, 0.30, 0.08), (0.09, 0.15, 0.05)], 12),
        ),
        "Hedge": Material(
            colour=white,
            metres=1.6,
            texture=tex.leaves([(0.05, 0.11, 0.03), (0.14, 0.24, 0.07), (0.03, 0.06, 0.02)], 13, 256),
        ),
        "Chrome": Material(colour=(0.78, 0.79, 0.80), mirror=True),
        "OvenGlass": Material(colour=(0.22, 0.22, 0.23), mirror=True),
        "Copper": Material(colour=(0.80, 0.46, 0.30), mirror=True),
    }
