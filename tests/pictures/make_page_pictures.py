"""Makes the pictures of docs/guide/page.md, of the page in Chromium.

    PYTHONPATH=tests python tests/pictures/make_page_pictures.py

It renders three of the jobs into out/page-pictures/, unless they are there.
"""

import io
import math
from collections.abc import Callable
from pathlib import Path

from PIL import Image
from support import ROOT
from support.browsers import DESKTOP, PHONE, Shown, browser, shown

import framearray
from framearray_cli.array.manifest import FILE_NAME
from framearray_cli.tools.view.show import open_server, open_tiles, prepare_all

PICTURES = ROOT / "docs" / "pictures"
ARRAYS = ROOT / "out" / "page-pictures"
QUALITY = 70  # of JPEG
TALL = (1280, 860)  # pixels; room for the controls of groups
THREADS = 2


def array(name: str) -> Path:
    """Render jobs/NAME.toml, unless it is there."""
    folder = ARRAYS / name
    if not (folder / FILE_NAME).is_file():
        framearray.render(ROOT / "jobs" / f"{name}.toml", output=folder)
    return folder


def desktop(page: Shown) -> None:
    """A path drawn over the pad."""
    page.page.click("#draw")
    page.drag([(2 + 0.4 * k, 6 - 4 * math.sin(0.14 * k)) for k in range(48)], steps=2)
    page.page.mouse.move(400, 760)


def phone(page: Shown) -> None:
    """As it opens."""


def groups(page: Shown) -> None:
    """The sun dimmed, the lamp tinted; the lamp's own axis."""
    page.page.locator("#group-sun").fill("0.35")
    page.page.locator("#group-lamp").fill("2")
    page.page.locator("#group-lamp-color").fill("#ffd0a0")
    page.page.focus("#pad")


SHOTS: dict[str, tuple[str, str, tuple[int, int], Callable[[Shown], None]]] = {
    "page-desktop": ("kitchen-small", "#camera=9&light=4", DESKTOP, desktop),
    "page-phone": ("stairs-small", "#camera=9&light=3", PHONE, phone),
    "page-groups": ("kitchen-evening", "#camera=8&light=4&axis.lamp=2&exposure=-0.3", TALL, groups),
}


def main() -> None:
    """Make all pictures again."""
    for name, (job, place, size, prepare) in SHOTS.items():
        tiles = open_tiles(array(job), None, THREADS)
        prepare_all(tiles, THREADS, lambda n: None)
        touch = {"has_touch": True, "is_mobile": True} if size == PHONE else {}
        with (
            browser() as chromium,
            open_server(tiles) as server,
            shown(chromium, server.url + place, size, **touch) as page,
        ):
            prepare(page)
            page.all_loaded()
            page.settle()
            image = Image.open(io.BytesIO(page.page.screenshot())).convert("RGB")
        file = PICTURES / f"{name}.jpg"
        image.save(file, "JPEG", quality=QUALITY, optimize=True, progressive=True)
        print(f"{file}: {image.width} x {image.height}, {file.stat().st_size:,} bytes")


if __name__ == "__main__":
    main()
