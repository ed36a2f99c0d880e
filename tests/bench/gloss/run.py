"""Measure glossy scenes: `python -m bench gloss`, or some of its parts by name -> docs/quality/gloss.csv.

Direct light: mean of pixels that show surfaces, ours minus Mitsuba's, with the standard error of both. Blocks: RMS
difference of means over 4 x 4 pixels over what the spread of independent passes of each program explains. All light:
with reuse and cells, RMSE of means over 4 x 4 pixels over their root mean square. Cost: ratios to diffuse surfaces.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image
from support.tables import Section, number, percent, write_csv

from bench.core.results import folder, load_some, save, site_for
from framearray_cli.base.colour import srgb8_from_linear

from . import against, cost

PARTS = (*cost.PARTS, *against.PLACES)
SHOWN = (cost.FILE, cost.CLEAR_PANES, cost.GREEN_PANES)
WIDTH, QUALITY = 240, 78  # of each picture; of JPEG


def run(names: Sequence[str], quick: bool) -> None:
    """Measure all parts, or some by name, and write the tables of all results."""
    out, site = folder(quick), site_for(quick)
    out.mkdir(parents=True, exist_ok=True)
    for part in [name for name in names if name != "page"] if names else PARTS:
        measured = cost.measure(part, quick, out) if part in cost.PARTS else against.measure(part, quick)
        save(out, f"gloss-{part}", measured)
    rows = []
    for scene, table in load_some(out, {scene: f"gloss-{scene}" for scene in against.PLACES}).items():
        if "skipped" not in table:
            direct, whole = table["direct"], table["all"]
            mean = f"{100 * direct['mean']:+.2f} +- {100 * direct['error']:.2f} %"
            cells = [number(direct["chi"]), percent(whole["all"], 2), number(whole["mean"])]
            rows.append([scene, percent(table["glossy"], 2), mean, *cells])
    costs = [
        (method, name, number(found["ms"]), f"{found['ratio']:.2f}", number(sum(found["rays"].values())))
        for method, table in load_some(out, {method: f"gloss-{part}" for part, method in cost.PARTS.items()}).items()
        for name, found in table["surfaces"].items()
    ]
    head = ("scene", "glossy triangles", "direct light", "blocks", "all light", "its mean")
    cost_head = ("indirect light", "surfaces", "ms per image", "ratio", "rays per pixel and image")
    write_csv(site.tables / "gloss.csv", [Section("Against Mitsuba", head, rows), Section("Cost", cost_head, costs)])
    if (images := out / "gloss-cost-cells.npz").is_file():
        _save_picture(images, site.pictures / "panes.jpg")


def _save_picture(images: Path, picture: Path) -> None:
    """Show the kitchen without panes, with clear and with green ones, from the images of the measurement of cost."""
    with np.load(images) as found:
        shown = [Image.fromarray(srgb8_from_linear(found[name])) for name in SHOWN]
    size = WIDTH, round(shown[0].height * WIDTH / shown[0].width)
    strip = np.concatenate([np.asarray(image.resize(size, Image.Resampling.LANCZOS)) for image in shown], axis=1)
    Image.fromarray(strip).save(picture, quality=QUALITY, optimize=True)
