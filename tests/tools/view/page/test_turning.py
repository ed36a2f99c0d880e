"""Turning environments and times of day on the page."""

from dataclasses import replace

import numpy as np
from support import handmade
from support.chromium import shown

from framearray_cli.array.manifest import ManifestLight
from framearray_cli.array.manifest_toml import write_manifest
from framearray_cli.base.colour import srgb8_from_linear
from framearray_cli.tools.mixing import SumOptions, open_pictures
from framearray_cli.tools.movie.pathfile import load_movie_path
from framearray_cli.tools.view.show import open_server, open_tiles


def test_a_slider_turns_the_environment(browser, tmp_path):
    manifest = handmade.circled(tmp_path / "out")
    sky = handmade.write_sky(tmp_path / "sky.exr")
    tiles = open_tiles(manifest.directory, None, 2, sky)
    with open_server(tiles) as server, shown(browser, f"{server.url}#camera=3") as page:
        assert page.get("document.querySelector('#axes h2').textContent") == "Environment: sky.exr"
        slider = page.page.locator("#axis-rotation")
        for turn in (9, 26):
            slider.fill(str(turn))
            assert slider.get_attribute("aria-valuetext") == f"position {turn} of 0 to 35, {10 * turn} degrees"
            assert page.place == (3, turn)
            shows = {}
            for degrees in (10.0 * turn, 10.0 * turn + 180):
                pictures, _ = open_pictures(manifest, SumOptions(environment=sky, rotate=(degrees, degrees)))
                truth = srgb8_from_linear(pictures.picture(3, (0.0,))).astype(float)
                shows[degrees] = float(np.sqrt(np.mean((page.pixels() - truth) ** 2)))
            assert shows[10.0 * turn] < 3.0 < shows[10.0 * turn + 180], "the map is turned, and not the other way"
        where = page.get("document.getElementById('where').textContent")
        assert where == "camera 3 of 0-6, rotation 26 of 0-35, 260\u00a0degrees"
        page.all_loaded()
        page.check(server.url)


def test_a_path_turns_the_environment(browser, tmp_path):
    """A saved path is one that `assemble` reads: the camera moves, and the map turns."""
    manifest = handmade.circled(tmp_path / "out")
    tiles = open_tiles(manifest.directory, None, 2, handmade.write_sky(tmp_path / "sky.exr"))
    with open_server(tiles) as server, shown(browser, server.url) as page:
        page.page.keyboard.press("d")
        for place in ((1, 3), (4, 12), (6, 0)):
            page.drag([place])
        text = page.get("framearray.path.toToml(framearray.array, framearray.view)")
        page.check(server.url)
    file = tmp_path / "path.toml"
    file.write_text(text)
    path = load_movie_path(file)
    assert [segment.camera for segment in path.segments] == [(1, 4), (4, 6)]
    assert path.environment.file == "sky.exr"
    assert [(time, value[0]) for time, value in path.environment.rotate.keys] == [(0, 30), (1, 120), (1, 120), (2, 0)]


DARK = (0.0, 0.0, 0.0)
WHERE = "document.getElementById('where').textContent"


def at(hour: int) -> ManifestLight:
    source = {"type": "directional", "time": f"2026-06-{21 + hour // 24}T{hour % 24:02d}:30:00+02:00"}
    return ManifestLight(ambient=DARK, ambient_error=DARK, sources=(source,))


def test_the_page_says_when(browser, tmp_path):
    manifest = handmade.plain(tmp_path / "study")
    manifest = replace(manifest, lights=tuple(at(8 * l) for l in range(manifest.n_lights)))
    write_manifest(manifest.directory, manifest)
    with (
        open_server(open_tiles(manifest.directory, None, 2)) as server,
        shown(browser, f"{server.url}#camera=2&light=1") as page,
    ):
        assert page.get(WHERE) == "camera 2 of 0-6, light 1 of 0-4, 2026-06-21\u00a008:30"
        page.drag([(3, 3)])
        assert page.get(WHERE) == "camera 3 of 0-6, light 3 of 0-4, 2026-06-22\u00a000:30"
        label = page.get("document.getElementById('picture').getAttribute('aria-label')")
        assert label.endswith(", 2026-06-22\u00a000:30")
        page.check(server.url)


def test_the_slider_of_another_axis_says_when(browser, tmp_path):
    manifest = handmade.grouped(tmp_path / "study")
    (name, n) = list(manifest.axes.items())[1]
    groups = tuple(
        replace(group, lights=tuple(at(8 * l) for l in range(n))) if group.axis == name else group
        for group in manifest.groups
    )
    write_manifest(manifest.directory, replace(manifest, groups=groups))
    with (
        open_server(open_tiles(manifest.directory, None, 2)) as server,
        shown(browser, f"{server.url}#{name}=1") as page,
    ):
        slider = page.page.locator(f"#axis-{name}")
        slider.fill("1")
        assert slider.get_attribute("aria-valuetext") == f"position 1 of 0 to {n - 1}, 2026-06-21 08:30"
