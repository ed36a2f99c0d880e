"""A panorama on the page: it is looked around in."""

from dataclasses import replace

import numpy as np
import pytest
from support import handmade
from support.browsers import shown

from framearray_cli.array.images import write_image
from framearray_cli.array.manifest import image_path
from framearray_cli.array.manifest_toml import write_manifest
from framearray_cli.tools.view.show import open_server, open_tiles

WIDTH, HEIGHT = 256, 128


@pytest.fixture(scope="module")
def panorama(tmp_path_factory):
    """Two positions of the light; red is the column and green the row, as shares."""
    folder = tmp_path_factory.mktemp("panorama")
    plain = handmade.plain(folder, n_c=1, n_l=2, layers=False)
    camera = replace(plain.cameras[0], fov=None, type="panorama")
    manifest = replace(plain, cameras=(camera,), resolution=(WIDTH, HEIGHT))
    x, y = np.meshgrid((np.arange(WIDTH) + 0.5) / WIDTH, (np.arange(HEIGHT) + 0.5) / HEIGHT)
    for l in range(2):
        image = np.stack([x, y, np.full_like(x, 0.25 * l)], axis=-1).astype(np.float32)
        write_image(image_path(manifest, 0, l), image, handmade.FLOAT)
    write_manifest(folder, manifest)
    with open_server(open_tiles(folder, None, 2)) as server:
        yield server


def seen(page, x, y):
    """Column and row of the panorama in a pixel of the view, from its colour."""
    codes = np.array([page.get(f"[...framearray.picture.pixelAt([{x}, {y}])]")], float) / 255
    linear = np.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4)[0]
    return linear[0] * WIDTH, linear[1] * HEIGHT


def turned(x, y, width, height, yaw, pitch, across):
    """The same by vectors: the ray through a pixel, turned up by the pitch, then right by the yaw."""
    ray = np.array([((2 * x + 1) / width - 1) * across, (1 - (2 * y + 1) / height) * across * height / width, -1.0])
    up = np.array([[1, 0, 0], [0, np.cos(pitch), -np.sin(pitch)], [0, np.sin(pitch), np.cos(pitch)]])
    right = np.array([[np.cos(yaw), 0, -np.sin(yaw)], [0, 1, 0], [np.sin(yaw), 0, np.cos(yaw)]])
    way = right @ up @ ray
    way /= np.linalg.norm(way)
    return (0.5 + np.arctan2(way[0], -way[2]) / (2 * np.pi)) * WIDTH, (0.5 - np.arcsin(way[1]) / np.pi) * HEIGHT


def test_a_drag_turns_the_view_and_the_wheel_zooms(either, panorama):
    with shown(either, panorama.url) as page:
        width, height = page.get(
            "[framearray.picture.gl.drawingBufferWidth, framearray.picture.gl.drawingBufferHeight]"
        )
        assert (width, height) == (128, 72)
        box = page.page.locator("#picture").bounding_box()
        middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

        def check():
            page.settle()
            yaw, pitch, across, _ = page.get("framearray.zoom.view")
            for x, y in ((20, 10), (64, 36), (110, 60)):
                right = turned(x, y, width, height, yaw, pitch, across)
                if 4 < right[0] < WIDTH - 4:  # between the first and the last column colours are a mixture
                    np.testing.assert_allclose(seen(page, x, y), right, atol=3)
            return yaw, pitch, across

        assert check() == (0, 0, 1)
        page.page.mouse.move(*middle)
        page.page.mouse.down()
        page.page.mouse.move(middle[0] - 100, middle[1] + 60, steps=3)
        page.page.mouse.up()
        yaw, pitch, _ = check()
        assert yaw > 0.1 and pitch > 0.05, "the picture follows the pointer: the view turns to the right and up"
        text = page.get("document.getElementById('probe').value")
        column, row = (int(part) for part in text.split(":")[0].split(","))
        found = page.get(f"framearray.zoom.sourceAt({middle[0] - 100}, {middle[1] + 60})")
        assert [column, row] == found
        page.page.mouse.wheel(0, -300)
        assert check()[2] < 0.7
        page.page.locator("#picture").focus()
        page.page.keyboard.press("ArrowRight")
        assert check()[0] > yaw, "arrows turn a view that has the focus"
        page.page.keyboard.press("v")
        assert check()[2] == 1
        page.page.locator("#pad").focus()
        page.page.keyboard.press("ArrowDown")
        page.settle()
        assert page.place == (0, 1), "and move the light on the pad"
        page.page.keyboard.press("c")
        page.page.keyboard.press("ArrowUp")
        check()
        page.check(panorama.url)
