"""Materials of the cabin: linear reflectivities, mostly 0.2 to 0.8."""

from ..common import textures as tex
from ..common.glb import Material


def materials() -> dict[str, Material]:
    """Linear reflectivities, mostly 0.2 to 0.8."""
    white = (1.0, 1.0, 1.0)
    return {
        "Carpet": Material(
            colour=white,
            metres=0.6,
            texture=tex.pile([(0.22, 0.27, 0.40), (0.36, 0.42, 0.56), (0.54, 0.47, 0.30)], 1, 512),
        ),
        "AisleCarpet": Material(
            colour=white,
            metres=0.5,
            texture=tex.lozenges((0.23, 0.28, 0.42), (0.54, 0.48, 0.35), (0.16, 0.19, 0.31), 2),
        ),
        "SeatCloth": Material(colour=white, metres=0.10, texture=tex.cloth((0.28, 0.42, 0.66), 3, 256, 32, 0.4)),
        "SeatShell": Material(colour=(0.60, 0.60, 0.61)),
        "Antimacassar": Material(colour=(0.80, 0.78, 0.72)),
        "Trim": Material(colour=(0.20, 0.21, 0.24)),
        "Tray": Material(colour=(0.62, 0.61, 0.58)),
        "Net": Material(colour=(0.30, 0.33, 0.40)),
        "Magazine": Material(colour=(0.70, 0.26, 0.16)),
        "Leaflet": Material(colour=(0.76, 0.76, 0.72)),
        "Screen": Material(
            colour=white,
            texture=tex.landscape(4, (0.30, 0.42, 0.60), [(0.22, 0.24, 0.34), (0.16, 0.24, 0.16), (0.30, 0.24, 0.10)]),
        ),
        "Belt": Material(colour=(0.30, 0.30, 0.32)),
        "Pillow": Material(colour=(0.74, 0.72, 0.66)),
        "Blanket": Material(colour=white, metres=0.16, texture=tex.cloth((0.56, 0.20, 0.14), 5, 256, 24, 0.4)),
        "Metal": Material(colour=(0.58, 0.58, 0.58)),
        "Panel": Material(colour=(0.80, 0.78, 0.73)),
        "WindowRim": Material(colour=(0.72, 0.71, 0.68)),
        "Blind": Material(colour=(0.70, 0.68, 0.62)),
        "Dado": Material(colour=(0.52, 0.53, 0.55)),
        "Bin": Material(colour=(0.80, 0.79, 0.76)),
        "Ceiling": Material(colour=(0.83, 0.83, 0.82)),
        "Cove": Material(colour=(0.62, 0.70, 0.80)),
        "Lamp": Material(colour=(0.84, 0.82, 0.74)),
        "Sign": Material(colour=(0.28, 0.30, 0.34)),
        "ExitSign": Material(colour=(0.16, 0.60, 0.26)),
        "Guide": Material(colour=(0.70, 0.74, 0.52)),
        "Bulkhead": Material(
            colour=white, metres=1.4, texture=tex.wood((0.60, 0.45, 0.29), (0.42, 0.29, 0.17), 6, 512, 1)
        ),
        "Curtain": Material(colour=white, metres=0.12, texture=tex.cloth((0.24, 0.32, 0.50), 7)),
        "Accent": Material(colour=(0.62, 0.20, 0.14)),
        "Steel": Material(colour=(0.60, 0.60, 0.60)),
        "Chrome": Material(colour=(0.78, 0.79, 0.80), mirror=True),
        "Mirror": Material(colour=(0.86, 0.88, 0.88), mirror=True),
    }
