"""The page in a browser: pictures by pointer, keys and touch; links, layers, exposure, groups."""

from dataclasses import replace

import numpy as np
import pytest
from support import handmade
from support.browsers import PHONE, shown, touch
from support.expected import bounds, decode, nearest_place, outside
from support.handmade import N_C, N_L, soft

from framearray_cli.array.images import read_codes
from framearray_cli.array.manifest_toml import write_manifest
from framearray_cli.array.pictures import Pictures, Relight, ambient_at
from framearray_cli.base.colour import linear_from_srgb, srgb8_from_linear
from framearray_cli.tools.view.show import open_server, open_tiles

ONE = (1.0, 1.0, 1.0)


def test_drag_shows_the_picture_under_the_pointer(browser, plain):
    with shown(browser, plain.url) as page:
        assert page.place == (0, 0)
        page.drag([(0, 0), (3, 2), (5, 4)])
        assert page.place == (5, 4)
        assert nearest_place(page.pixels()) == (5, 4)
        page.drag([(2, 1)])
        assert nearest_place(page.pixels()) == (2, 1)
        assert page.get("document.getElementById('where').textContent") == "camera 2 of 0-6, light 1 of 0-4"
        page.drag([(6, 3), (40, -40)])
        assert page.place == (6, 0), "outside of the pad the nearest place counts"
        page.all_loaded()
        page.check(plain.url)


@pytest.mark.parametrize("exposure", [0.0, -2.5, 1.0])
def test_pixels_are_those_of_the_image_at_an_exposure(browser, plain, exposure):
    with shown(browser, f"{plain.url}#camera=4&light=3&exposure={exposure}") as page:
        pixels = page.pixels()
        low, high = bounds(plain.tiles, 4, [("light", 3, ONE)], exposure)
        assert outside(pixels, low, high) == 0.0
        assert nearest_place(pixels, exposure) == (4, 3)
        others = (
            bounds(plain.tiles, 4, [("light", 3, ONE)], exposure + 0.3),
            bounds(plain.tiles, 3, [("light", 3, ONE)], exposure),
        )
        assert all(outside(pixels, *other) > 0.1 for other in others), "another exposure, another camera"


def test_the_pad_has_the_means_of_pictures(browser, plain):
    """A bright hill moves over each: the middle of a picture says little of its mean."""
    with shown(browser, plain.url) as page:
        page.all_loaded()
        page.wait("!framearray.map.changed")
        means = np.reshape(page.get("[...framearray.map.means.get('light')]"), (N_C, N_L, 3))
    stream, layout = plain.tiles.streams[0], plain.tiles.layout
    for c in range(N_C):
        codes = read_codes(plain.tiles.ensure_tile("light", c, None)).astype(np.float32)
        truth = np.array([codes[layout.part(l)].mean(axis=(0, 1)) for l in range(N_L)])
        low, high = (decode(np.rint(truth + by).astype(np.uint8), stream.coding) for by in (-1.5, 1.5))
        assert np.all((low <= means[c]) & (means[c] <= high)), c
        height, width = layout.height, layout.width
        middle = np.array([codes[layout.part(l)][height // 2, width // 2] for l in range(N_L)])
        assert np.abs(middle - truth).max() > 10, "the comparison can fail"


def test_bright_light_survives_for_the_exposure(browser, plain):
    """Values of 3 and 6 are both white at first, and differ three stops darker."""
    with shown(browser, f"{plain.url}#camera=2&light=2&exposure=-3") as page:
        truth = srgb8_from_linear(soft(2, 2, 6.0) / 8).astype(float)
        assert truth.max() > 200
        assert np.sqrt(np.mean((page.pixels() - truth) ** 2)) < 3.0


def test_keys_reach_everything(either, plain):
    with shown(either, plain.url) as page:
        press = page.page.keyboard.press
        for key in ("ArrowRight", "ArrowRight", "ArrowRight", "ArrowLeft", "ArrowDown"):
            press(key)
        assert page.place == (2, 1)
        assert nearest_place(page.pixels()) == (2, 1)
        press("End"), press("PageDown"), press("ArrowRight")
        assert page.place == (N_C - 1, N_L - 1)
        press("Shift+ArrowLeft"), press("PageUp")
        assert page.place == (0, 0)
        press("+"), press("+"), press("-")
        assert page.get("framearray.view.exposure") == 0.5
        reached = []
        for _ in range(20):
            press("Tab")
            reached.append(page.get("document.activeElement.id || document.activeElement.value"))
            ring = page.get("""(() => { const at = document.activeElement;
                const seen = at.name === "layer" ? at.nextElementSibling : at;
                return at === document.body || !document.hasFocus() ||  // among the browser's own buttons
                    getComputedStyle(seen).outlineStyle !== "none"; })()""")
            assert ring, f"the focus on {reached[-1]} cannot be seen"
        known = {"pad", "play-camera", "play-light", "speed", "draw", "picture", "exposure", "link", "help"}
        assert known <= set(reached)
        page.page.focus("#exposure")
        press("ArrowRight")
        assert page.get("framearray.view.exposure") == 0.6
        assert page.place == (0, 0), "on a slider arrows move the slider"
        page.check(plain.url)


def test_controls_have_names(browser, plain, grouped):
    for server in (plain, grouped):
        with shown(browser, server.url) as page:
            nameless = page.get("""[...document.querySelectorAll("button, input, select, [tabindex]")].filter((at) =>
                !(at.textContent.trim() || at.getAttribute("aria-label") || at.getAttribute("aria-labelledby")
                  || at.labels?.length)).map((at) => at.outerHTML)""")
            assert nameless == []


def test_touch_on_a_phone(browser, plain):
    with shown(browser, plain.url, PHONE, has_touch=True, is_mobile=True) as page:
        x, y = page.on_pad(4, 2)
        page.page.touchscreen.tap(x, y)
        assert page.place == (4, 2)
        assert nearest_place(page.pixels()) == (4, 2)
        boxes = {name: page.page.locator(f"#{name}").bounding_box() for name in ("picture", "pad", "play-camera")}
        assert boxes["picture"]["y"] + boxes["picture"]["height"] <= boxes["pad"]["y"]
        assert boxes["pad"]["y"] + boxes["pad"]["height"] < PHONE[1], "picture and pad fit on the screen"
        assert boxes["play-camera"]["height"] >= 44, "large enough for a thumb"
        assert page.get("document.documentElement.scrollWidth") <= PHONE[0], "nothing sticks out"
        touch(page.page, *([page.on_pad(*place)] for place in ((0, 0), (3, 3), (6, 1))))
        assert page.place == (6, 1)
        assert page.get("scrollY") == 0, "a finger on the pad does not scroll"
        page.check(plain.url)


def test_a_link_reopens_the_place(browser, grouped):
    with shown(browser, grouped.url) as page:
        page.drag([(0, 0), (3, 2)])
        page.page.focus("#axis-lamps")
        page.page.keyboard.press("ArrowRight")
        page.page.locator("#exposure").fill("-1.5")
        page.page.locator("#group-lamps").fill("2.5")
        page.page.locator("#group-lamps-color").fill("#ffcc88")
        page.page.locator("#ambient").fill("0")
        page.page.click("#link")
        page.settle()
        link, pixels, view = page.page.url, page.pixels(), page.get("framearray.view")
    assert view["places"] == {"light": 2, "lamps": 1} and view["tints"]["lamps"]["color"] == "#ffcc88"
    with shown(browser, link) as page:
        assert page.get("framearray.view") == view
        np.testing.assert_array_equal(page.pixels(), pixels)
        page.page.click("#reset")
        assert (page.pixels() != pixels).mean() > 0.5
        page.page.goto(f"{grouped.url}#x=1&camera=900&light=-3&show=none&exposure=nan&ambient=2")
        page.settle()
        assert page.place == (3, 0), "what does not fit the array is put right"
        page.check(grouped.url)


def test_layers(browser, plain):
    with shown(browser, f"{plain.url}#camera=3&light=1") as page:
        keys = page.get("framearray.array.layers.map((layer) => layer.key)")
        assert keys == ["obscurance", "indirect", "reflectivity", "depth", "normal"]
        page.page.check("input[value=reflectivity]", force=True)
        low, high = bounds(plain.tiles, 3, [("reflectivity", 0, ONE)])
        assert outside(page.pixels(), low, high) == 0.0
        page.page.check("input[value=depth]", force=True)
        shade = page.pixels()[..., 0].astype(float)
        near_is_light = np.corrcoef(shade.ravel(), soft(3, 0)[..., 0].ravel())[0, 1]
        assert near_is_light < -0.8
        assert page.get("document.getElementById('legend').textContent").startswith("Depth: 0 to ")
        assert page.get("document.getElementById('exposure').disabled")
        page.check(plain.url)


def test_light_of_groups_changes_as_in_pictures(browser, grouped):
    manifest = grouped.tiles.manifest
    lamps = 0.5 * linear_from_srgb(np.array([0xFF, 0xCC, 0x88]) / 255)
    with shown(browser, f"{grouped.url}#camera=2&light=1&axis.lamps=1") as page:
        as_rendered = page.pixels()
        page.page.focus("#group-lamps")
        for _ in range(10):
            page.page.keyboard.press("ArrowLeft")  # a twentieth each
        page.page.locator("#group-lamps-color").fill("#ffcc88")
        page.page.locator("#ambient").fill("2")
        page.page.locator("#group-background").fill("0.25")
        pixels = page.pixels()
        page.check(grouped.url)
    sky = (0.25, 0.25, 0.25)
    i_a = lamps * 0.1 + ambient_at(manifest.groups[1].lights, 1) + 0.25 * np.array(manifest.background_ambient)
    parts = [("g0", 1, tuple(lamps)), ("g1", 1, ONE), ("ambient", 0, tuple(2 * i_a)), ("background", 0, sky)]
    assert outside(pixels, *bounds(grouped.tiles, 2, parts)) == 0.0
    relight = Relight(groups={"lamps": tuple(lamps), "background": sky}, ambient=(2.0, 2.0, 2.0))
    for shown_, wanted, other in ((pixels, relight, Relight()), (as_rendered, Relight(), relight)):
        right, wrong = (srgb8_from_linear(Pictures(manifest).picture(2, (1, 1), light)) for light in (wanted, other))
        assert np.abs(right - shown_.astype(float)).mean() < 1.0 < np.abs(wrong - shown_.astype(float)).mean()


def test_play_goes_back_and_forth(browser, plain):
    with shown(browser, plain.url) as page:
        page.all_loaded()
        page.page.click("#play-camera")
        page.wait("framearray.view.c === framearray.array.nCameras - 1")
        page.wait("framearray.view.c <= 1")
        page.page.click("#play-camera")
        assert page.get("document.getElementById('play-camera').ariaPressed") == "false"
        place = page.place
        page.page.focus("#pad")
        page.page.keyboard.press("l")
        page.wait("framearray.l === 3")
        page.page.keyboard.press("l")
        assert page.place[0] == place[0], "camera and light play independently"
        page.check(plain.url)


def test_playing_turns_at_the_ends(browser, plain):
    with shown(browser, plain.url) as page:
        walk = """import("./player.js").then(({ bounce }) => {
            let at = 0, direction = 1;
            return Array.from({ length: 9 }, () => {
                ({ to: at, direction } = bounce(at, STEPS * direction, 4));
                return at;
            });
        })"""
        assert page.get(walk.replace("STEPS", "1")) == [1, 2, 3, 2, 1, 0, 1, 2, 3]
        assert page.get(walk.replace("STEPS", "2")) == [2, 2, 0, 2, 2, 0, 2, 2, 0], "a slow screen leaves images out"


def test_memory_stays_within_its_budget(browser, plain):
    """The sheets and pictures of all places take more than 0.1 MiB, which is allowed here."""
    with shown(browser, f"{plain.url}?memory=0.1") as page:
        for l in range(N_L):
            page.drag([(0, l), (N_C - 1, l)], steps=N_C)
        page.drag([(5, 2)])
        assert nearest_place(page.pixels()) == (5, 2)
        most, budget = page.get("[framearray.store.most, framearray.store.budget]")
        needed = 4 * 64 * 48 * N_C * N_L
        assert 0 < most <= budget < needed
        page.check(plain.url)


def test_light_from_cells_has_no_ambient_light(browser, tmp_path):
    manifest = replace(handmade.grouped(tmp_path / "cells"), job={"indirect": {"method": "cells"}})
    write_manifest(manifest.directory, manifest)
    with (
        open_server(open_tiles(manifest.directory, None, 2)) as server,
        shown(browser, f"{server.url}#camera=2&light=1") as page,
    ):
        roles = page.get("framearray.array.streams.map((stream) => stream.role)")
        assert roles == ["group", "group", "background"]
        assert page.get("document.getElementById('ambient')") is None
        page.page.locator("#group-lamps").fill("0.5")
        pixels = page.pixels()
        page.check(server.url)
    parts = [("g0", 0, (0.5,) * 3), ("g1", 1, ONE), ("background", 0, ONE)]
    assert outside(pixels, *bounds(server.tiles, 2, parts)) == 0.0
