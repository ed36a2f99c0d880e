"""Results -> docs/quality/gloss.csv. Nothing is measured here."""

from pathlib import Path

import numpy as np
from PIL import Image
from support.tables import publish

from bench.core.markdown import grid, number, percent
from bench.core.results import Table, folder, load, site_for
from framearray_cli.base.colour import srgb8_from_linear

from . import cost
from .against import PLACES

SHOWN = (cost.FILE, cost.CLEAR_PANES, cost.GREEN_PANES)
PANES = "The kitchen without panes, with clear ones and with green ones"
WIDTH, QUALITY = 240, 78  # of each picture; of JPEG

HEAD = """
# Gloss

`make bench-gloss` measures and writes this page; [gloss](../decisions/gloss.md) and [glass](../decisions/glass.md) say
how surfaces work.

## Against Mitsuba

Scenes of other people whose surfaces follow the file (`scene.surfaces = "file"`; glass is opaque, nothing shines),
under a lamp, against Mitsuba 3 with the surface of glTF 2.0, appendix B, written for it in
`tests/bench/truth/mitsubagloss.py`.

*Direct light*: native hits of one eye, without mirrors, against Mitsuba's samples of the same lamp; means of pixels
that show surfaces, ours minus Mitsuba's, with the standard error of both. *Blocks*: RMS difference of means over 4 x
4 pixels over what the spread of independent passes of each program explains; 1 where noise is all. *All light*: with
reuse and `indirect.method = "cells"`, RMSE of means over 4 x 4 pixels over their root mean square, the noise of the
path-traced picture taken out; and the mean of the picture over the path-traced one.
"""
COST = """
## Cost

`jobs/kitchen-gloss.toml` with diffuse surfaces, as it is, and with a pane in each window, frame by frame in turns: hits
and composing, without writing. Ratios are medians over frames, to diffuse surfaces with the same indirect light.
"""


def write(quick: bool) -> None:
    """Write the page from all results there are; quick results go beside themselves."""
    out, page = folder(quick), site_for(quick).pages / "gloss.md"
    rows = []
    for scene in PLACES:
        table = load(out, f"gloss-{scene}")
        if table is not None:
            rows.append(_row(scene, table))
    costs = [row for part, method in cost.PARTS.items() for row in _costs(method, load(out, f"gloss-{part}"))]
    heads = ("scene", "glossy triangles", "direct light", "blocks", "all light", "its mean")
    page.parent.mkdir(parents=True, exist_ok=True)
    of_cost = ("indirect light", "surfaces", "ms per image", "ratio", "rays per pixel and image")
    text = f"{HEAD.strip()}\n\n{grid(heads, rows)}\n\n{COST.strip()}\n\n{grid(of_cost, costs)}\n"
    site = site_for(quick)
    if (picture := _picture(out / "gloss-cost-cells.npz", site.pictures / "panes.jpg")) is not None:
        text += f"\n![{PANES}]({site.link(picture)})\n\n*{PANES}.*\n"
    page = publish(page, text)
    print(page)


def _picture(images: Path, picture: Path) -> Path | None:
    """Show the kitchen by its panes, from the images of the measurement of cost; None without."""
    if not images.is_file():
        return None
    with np.load(images) as found:
        shown = [Image.fromarray(srgb8_from_linear(found[name])) for name in SHOWN]
    width, height = WIDTH, round(shown[0].height * WIDTH / shown[0].width)
    strip = Image.new("RGB", (width * len(shown), height))
    for k, image in enumerate(shown):
        strip.paste(image.resize((width, height), Image.Resampling.LANCZOS), (k * width, 0))
    picture.parent.mkdir(parents=True, exist_ok=True)
    strip.save(picture, quality=QUALITY, optimize=True)
    return picture


def _row(scene: str, table: Table) -> list[str]:
    if "skipped" in table:
        return [scene, table["skipped"], "", "", "", ""]
    direct, whole = table["direct"], table["all"]
    mean = f"{100 * direct['mean']:+.2f} +- {100 * direct['error']:.2f} %"
    return [
        scene, percent(table["glossy"], 2), mean, number(direct["chi"]), percent(whole["all"], 2),
        number(whole["mean"]),
    ]  # fmt: skip


def _costs(method: str, table: Table | None) -> list[list[str]]:
    if table is None:
        return []
    return [
        [method, name, number(found["ms"]), f"{found['ratio']:.2f}", number(sum(found["rays"].values()))]
        for name, found in table["surfaces"].items()
    ]
