"""Looking closely at the picture: zoom, values under the pointer, comparison, stills, themes."""

import re
from contextlib import ExitStack
from functools import partial

import numpy as np
import pytest
from support.browsers import DARK_FIREFOX, DESKTOP, PHONE, shown, started, touch
from support.expected import decode, nearest_place
from support.handmade import SIZE, soft

from framearray_cli.array.images import read_codes
from framearray_cli.base.colour import LUMINANCE, linear_from_srgb

SCALE = "framearray.zoom.scale"


def middle(page) -> tuple[float, float]:
    box = page.page.locator("#stage").bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def pixel_at(page, x: float, y: float) -> list[int]:
    return page.get(f"framearray.zoom.pixelAt({x}, {y})")


def test_a_wheel_zooms_about_the_pointer(any_browser, plain):
    with shown(any_browser, plain.url) as page:
        x, y = middle(page)
        x, y = x + 170, y - 90
        before = pixel_at(page, x, y)
        page.page.mouse.move(x, y)
        for _ in range(4):
            page.page.mouse.wheel(0, -200)
        page.wait(f"{SCALE} > 6")
        np.testing.assert_allclose(pixel_at(page, x, y), before, atol=1)
        page.page.mouse.down()
        page.page.mouse.move(x + 50, y + 40)
        page.page.mouse.up()
        np.testing.assert_allclose(pixel_at(page, x + 50, y + 40), before, atol=1)
        assert page.place == (0, 0), "a drag on the picture is no step"
        page.page.mouse.wheel(0, 5000)
        page.wait(f"{SCALE} === 1")
        assert pixel_at(page, x, y) == before
        page.check(plain.url)


def test_one_to_one_and_back(any_browser, plain):
    with shown(any_browser, plain.url) as page:
        page.page.click("#one-to-one")
        box = page.page.locator("#picture").bounding_box()
        x, y = middle(page)
        assert pixel_at(page, x + 10.5, y + 3.5) == [SIZE[0] // 2 + 10, SIZE[1] // 2 + 3], box
        assert page.page.locator("#one-to-one").is_disabled()
        page.page.click("#fit")
        assert page.get(SCALE) == 1


def test_a_double_click_zooms_and_back(browser, plain):
    with shown(browser, plain.url) as page:
        for scale in (2, 1):
            page.page.mouse.dblclick(*middle(page))
            assert page.get(SCALE) == scale


def test_keys_zoom_and_move(either, plain):
    with shown(either, plain.url) as page:
        press = page.page.keyboard.press
        for key in "zzzz":
            press(key)
        assert page.get(SCALE) == pytest.approx(1.25**4)
        press("ArrowRight")
        assert page.place == (1, 0), "arrows walk unless the picture has the focus"
        x, y = middle(page)
        before = pixel_at(page, x, y)
        page.page.focus("#picture")
        press("ArrowRight")
        assert page.place == (1, 0) and pixel_at(page, x, y)[0] > before[0]
        press("x"), press("v")
        assert page.get(SCALE) == 1
        press("ArrowRight")
        assert page.place == (2, 0), "a whole picture has nowhere to move"
        page.check(plain.url)


def test_two_fingers_zoom(browser, plain):
    with shown(browser, plain.url, PHONE, has_touch=True, is_mobile=True) as page:
        box = page.page.locator("#picture").bounding_box()
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        touch(page.page, *([(x - apart, y), (x + apart, y)] for apart in (40, 60, 80)))
        assert page.get(SCALE) == pytest.approx(2, rel=0.1)


def test_the_value_under_the_pointer(either, plain):
    with shown(either, f"{plain.url}#camera=3&light=2&exposure=-1") as page:
        page.settle()
        x, y = middle(page)
        page.page.mouse.move(x, y)
        column, row = pixel_at(page, x, y)
        text = page.get("document.getElementById('probe').value")
        found = re.fullmatch(rf"{column}, {row}: (\S+)  (\S+)  (\S+), shown #(\w{{6}})", text)
        assert found, text
        codes = read_codes(plain.tiles.ensure_tile("light", 3, 2))[row, column].astype(float)
        low, high = (decode(np.rint(codes + by).astype(np.uint8), plain.tiles.streams[0].coding) for by in (-2, 2))
        values = np.array([float(n) for n in found.groups()[:3]])
        assert np.all((0.99 * low <= values) & (values <= 1.01 * high)), (low, values, high)
        assert list(bytes.fromhex(found[4])) == page.pixels()[row, column].tolist()
        page.page.check("input[value=depth]", force=True)
        page.settle()
        page.page.mouse.move(x + 1, y)
        text = page.get("document.getElementById('probe').value")
        assert float(text.split(": ")[1].split(",")[0]) == pytest.approx(8 * soft(3, 0)[row, column, 0], rel=0.06)
        page.page.mouse.move(*page.on_pad(0, 0))
        assert page.page.locator("#probe").is_hidden()


def test_two_places_are_compared(any_browser, plain):
    with shown(any_browser, f"{plain.url}#camera=1&light=1") as page:
        page.page.keyboard.press("c")
        page.drag([(5, 3)])
        page.page.locator("#split").fill("25")
        page.all_loaded()
        pixels = page.pixels()
        line = page.page.locator("#split-line")
        assert line.get_attribute("data-place") == "camera 1, light 1"
    quarter = SIZE[0] // 4
    for place, columns in (((5, 3), slice(0, quarter)), ((1, 1), slice(quarter, None))):
        with shown(any_browser, f"{plain.url}#camera={place[0]}&light={place[1]}") as page:
            np.testing.assert_array_equal(pixels[:, columns], page.pixels()[:, columns])
            page.page.click("#compare")
            page.page.click("#compare")
            assert page.page.locator("#split").is_hidden()
            page.check(plain.url)


def test_a_still_is_saved(any_browser, plain, tmp_path):
    with shown(any_browser, f"{plain.url}#camera=4&light=3") as page:
        pixels = page.pixels()
        still, image = (page.saved(tmp_path, partial(page.page.click, name)) for name in ("#save-picture", "#save-exr"))
    assert still.name == "room.c0004.l003.png"
    assert image.read_bytes() == (plain.tiles.manifest.directory / image.name).read_bytes()
    np.testing.assert_array_equal(read_codes(still)[..., :3], pixels)
    assert nearest_place(pixels) == (4, 3)


def test_play_says_pause(browser, plain):
    with shown(browser, plain.url) as page:
        button = page.page.locator("#play-camera")
        assert button.text_content() == "Play camera"
        button.click()
        assert button.text_content() == "Pause camera"
        button.click()
        assert button.text_content() == "Play camera"


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_can_be_read_in_both_themes(any_browser, driver, plain, scheme):
    """Contrast of at least 4.5 to 1 [WCAG 2.2, 1.4.3]."""
    with ExitStack() as stack:
        if scheme == "dark" and any_browser.browser_type.name == "firefox":
            any_browser = stack.enter_context(started(driver, "firefox", **DARK_FIREFOX))
        page = stack.enter_context(shown(any_browser, plain.url, color_scheme=scheme))
        colours = page.get("""["#name", "#where", "#draw", "h2"].map((name) => {
            const at = document.querySelector(name), found = [getComputedStyle(at).color];
            for (let up = at; up; up = up.parentElement) {
                const back = getComputedStyle(up).backgroundColor;
                if (back !== "rgba(0, 0, 0, 0)") return [...found, back];
            }
        })""")
        panel = page.get("getComputedStyle(document.getElementById('panel')).backgroundColor")
        assert (luminance(panel) > 0.5) == (scheme == "light")
        for text, back in colours:
            low, high = sorted((luminance(text), luminance(back)))
            assert (high + 0.05) / (low + 0.05) >= 4.5, (text, back)


def luminance(colour: str) -> float:
    codes = np.array([int(n) for n in re.findall(r"\d+", colour)[:3]]) / 255
    return float(linear_from_srgb(codes) @ LUMINANCE)


@pytest.mark.parametrize(
    ("size", "scheme"),
    [
        pytest.param(DESKTOP, "light", id="desktop-light"),
        pytest.param(DESKTOP, "dark", id="desktop-dark", marks=pytest.mark.slow),
        pytest.param(PHONE, "light", id="phone-light", marks=pytest.mark.slow),
        pytest.param(PHONE, "dark", id="phone-dark"),
    ],
)
def test_axe_finds_nothing(browser, plain, grouped, scheme, size):
    """Rules of WCAG 2 and good practice, with everything open."""
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="needs axe-playwright-python (extra dev)")
    for server in (plain, grouped):
        with shown(browser, server.url, size, color_scheme=scheme) as page:
            for key in ("c", "d", "Enter", "End", "Enter", "?"):
                page.page.keyboard.press(key)
            page.settle()
            _check_rules(axe, page)
        with shown(browser, f"{server.url}#embed&camera=1", size, color_scheme=scheme) as page:
            page.settle()
            _check_rules(axe, page)


def _check_rules(axe, page):
    found = axe.Axe().run(page.page).response["violations"]
    assert [(one["id"], [node["html"] for node in one["nodes"]]) for one in found] == []
