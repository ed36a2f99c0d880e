"""Results -> docs/measured/gloss.md. Nothing is measured here."""

from bench.core.markdown import grid, number, percent
from bench.core.results import Table, folder, load, site_for

from .against import PLACES

HEAD = """
# Gloss against Mitsuba

Scenes of other people whose surfaces follow the file (`scene.surfaces = "file"`; glass is opaque, nothing shines),
under a lamp, against Mitsuba 3 with the surface of glTF 2.0, appendix B, written for it in
`tests/bench/ambient/gloss.py`. `make bench-gloss` measures and writes this page; [gloss](../decisions/gloss.md) says
how the surfaces work.

*Direct light*: native hits of one eye, without mirrors, against Mitsuba's samples of the same lamp; means of pixels
that show surfaces, ours minus Mitsuba's, with the standard error of both. *Blocks*: RMS difference of means over 4 x
4 pixels over what the spread of independent passes of each program explains; 1 where noise is all. *All light*: with
reuse and `indirect.method = "cells"`, RMSE of means over 4 x 4 pixels over their root mean square, the noise of the
path-traced picture taken out; and the mean of the picture over the path-traced one.
"""


def write(quick: bool) -> None:
    """Write the page from all results there are; quick results go beside themselves."""
    out, page = folder(quick), site_for(quick).pages / "gloss.md"
    rows = []
    for scene in PLACES:
        table = load(out, f"gloss-{scene}")
        if table is not None:
            rows.append(_row(scene, table))
    heads = ("scene", "glossy triangles", "direct light", "blocks", "all light", "its mean")
    page.parent.mkdir(parents=True, exist_ok=True)
    page.write_text(f"{HEAD.strip()}\n\n{grid(heads, rows)}\n", encoding="utf-8")
    print(page)


def _row(scene: str, table: Table) -> list[str]:
    if "skipped" in table:
        return [scene, table["skipped"], "", "", "", ""]
    direct, whole = table["direct"], table["all"]
    mean = f"{100 * direct['mean']:+.2f} +- {100 * direct['error']:.2f} %"
    return [
        scene, percent(table["glossy"], 2), mean, number(direct["chi"]), percent(whole["all"], 2),
        number(whole["mean"]),
    ]  # fmt: skip
