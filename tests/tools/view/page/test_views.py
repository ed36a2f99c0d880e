"""The page's views, turning environments, and times of day."""

import json
from base64 import b64decode, b64encode
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from support import handmade
from support.chromium import Shown, shown
from support.expected import decode
from support.studio import write_studio

from framearray_cli.array.images import read_codes
from framearray_cli.array.manifest import ManifestLight
from framearray_cli.array.manifest_toml import write_manifest
from framearray_cli.base.arrays import Bytes, Image
from framearray_cli.base.colour import srgb8_from_linear
from framearray_cli.tools.display import View, find_view
from framearray_cli.tools.mixing import SumOptions, open_pictures
from framearray_cli.tools.movie.pathfile import load_movie_path
from framearray_cli.tools.view.server import PageServer
from framearray_cli.tools.view.show import open_server, open_tiles

OLDER = "P3-D60 - Display/ACES 1.0 - SDR Cinema"  # divides by the brightness
# By formulas and tables of one dimension; by tables of three, linear and in tetrahedra.
NAMES = ("aces", "Film", "Screen/Sharp", OLDER)
BUILT_IN = ("ocio://default", "ocio://studio-config-v2.1.0_aces-v1.3_ocio-v2.3")
SIZE = (128, 96)


@pytest.fixture(scope="module")
def views(tmp_path_factory) -> list[View]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("OCIO", str(write_studio(tmp_path_factory.mktemp("studio"))))
        found = [find_view(name) for name in NAMES[:-1]]
        patch.setenv("OCIO", BUILT_IN[1])
        return [*found, find_view(OLDER)]


@pytest.fixture(scope="module")
def served(tmp_path_factory, views) -> Iterator[PageServer]:
    manifest = handmade.plain(tmp_path_factory.mktemp("views"), n_c=2, n_l=2, layers=False)
    with open_server(open_tiles(manifest.directory, None, 1, None, views)) as server:
        yield server


def colours() -> Image:
    """Radiance as in pictures and beyond: dark, bright, pure, black, too bright."""
    rng = np.random.default_rng(2)
    width, height = SIZE
    image = np.exp(rng.normal(-1.5, 2.0, (height, width, 1))) * rng.uniform(0, 1, (height, width, 3))
    image[0, :6] = [[0, 0, 0], [1, 0, 0], [0, 1e-6, 0], [1e4, 1e4, 1e4], [0, 0, 5], [64, 0, 64]]
    image[1] = np.linspace(0, 4, width)[:, None]
    return np.asarray(image, np.float32)


def encoded(page: Shown, image: Image) -> Bytes:
    """Return the codes of radiance by the shader of the page's view."""
    height, width, _ = image.shape
    page.wait("framearray.shader")
    text = page.get(
        f"""(() => {{
        const bytes = Uint8Array.from(atob('{b64encode(image.tobytes()).decode()}'), (one) => one.charCodeAt(0));
        const codes = framearray.encode(new Float32Array(bytes.buffer), {width}, {height});
        return btoa(codes.reduce((all, x) => all + String.fromCharCode(x), '')); }})()"""
    )
    return np.frombuffer(b64decode(text), np.uint8).reshape(height, width, 4)[..., :3]


def codes_of(view: View, image: Image) -> Image:
    return np.rint(255 * view.encode(image))


def test_the_page_shows_views_as_opencolorio_does(browser, served, views):
    """At most one code different, for any radiance; and the picture on the screen is that of its tile."""
    with shown(browser, f"{served.url}#camera=1&light=1&exposure=-1") as page:
        assert page.get("framearray.view.look") == "aces", "the first that was asked for"
        tile = read_codes(served.tiles.ensure_tile("light", 1, 1))
        radiance = decode(tile, served.tiles.streams[0].coding) / np.float32(2)
        image, seen = colours(), {}
        brighter = encoded(page, image * np.float32(1.05))
        assert np.abs(brighter - codes_of(views[0], image)).max() > 1, "the comparison can fail"
        for view in views:
            page.page.locator("#view").select_option(view.name)
            page.settle()
            error = np.abs(encoded(page, image) - codes_of(view, image))
            assert error.max() <= 1, view.name
            page.wait("framearray.level === 2 && !framearray.isDirty")
            seen[view.name] = page.pixels().astype(float)
            # decoders of JPEG may differ by a code, of which a view makes up to a few
            apart = np.abs(seen[view.name] - codes_of(view, radiance))
            assert np.percentile(apart, 99) <= 2 and apart.mean() < 0.5
            other = next(one for one in views if one is not view)
            assert np.abs(seen[view.name] - codes_of(other, radiance)).mean() > 1
        page.page.locator("#view").select_option("aces")
        page.settle()
        page.all_loaded()
        page.get("framearray.map.means.get('light').fill(0.3), framearray.map.changed = true, framearray.dirty()")
        page.wait("!framearray.map.changed")
        pad = page.get("[...framearray.map.canvas.getContext('2d').getImageData(0, 0, 2, 2).data]")
        grey = codes_of(views[0], np.full((2, 2, 3), 0.15, np.float32))
        assert np.abs(np.reshape(pad, (2, 2, 4))[..., :3] - grey).max() <= 1, "the pad, too"
        page.page.locator("#view").select_option("srgb")
        assert not np.array_equal(page.pixels(), seen["aces"])
        page.page.locator("#pad").focus()
        page.page.keyboard.press("v")  # from the last to the first
        assert np.array_equal(page.pixels(), seen["aces"])
        page.page.keyboard.press("v")
        page.settle()
        page.page.wait_for_timeout(400)  # until the address follows
        assert "view=Film" in page.get("location.hash")
        page.check(served.url)


def test_a_link_names_the_view_and_a_broken_file_is_reported(browser, served):
    with shown(browser, f"{served.url}#view=Screen%2FSharp") as page:
        assert page.get("framearray.view.look") == "Screen/Sharp"
        table = page.get("framearray.array.contents.views")
        assert [row["name"] for row in table] == [*NAMES, "srgb"], json.dumps(table)
        page.page.route("**/views/*.bin", lambda route: route.abort())
        page.page.locator("#view").select_option("Film")
        page.wait("document.getElementById('note').textContent.startsWith('View Film: cannot be loaded')")


@pytest.mark.slow
@pytest.mark.parametrize("config", BUILT_IN)
def test_every_view_of_opencolorios_own_configurations(browser, tmp_path, monkeypatch, config):
    import PyOpenColorIO as ocio

    monkeypatch.setenv("OCIO", config)
    known = ocio.Config.CreateFromFile(config)
    names = [f"{display}/{view}" for display in known.getDisplays() for view in known.getViews(display)]
    views = [find_view(name) for name in names]
    manifest = handmade.plain(tmp_path, n_c=1, n_l=1, layers=False)
    image, errors = colours(), {}
    with (
        open_server(open_tiles(manifest.directory, None, 1, None, views)) as server,
        shown(browser, server.url) as page,
    ):
        for view in views:
            page.get(f"framearray.change((view) => (view.look = {json.dumps(view.name)}))")
            errors[view.name] = np.abs(encoded(page, image) - codes_of(view, image)).max()
    assert len(errors) > 30
    assert {name: error for name, error in errors.items() if error > 1} == {}


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
