"""Paths: drawn by pointer and keys, played, and saved as a file for `assemble`."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
from support.browsers import shown
from support.program import complete

from framearray_cli.array.images import read_codes, read_image
from framearray_cli.array.manifest import image_path


def saved(page, folder: Path) -> Path:
    return page.saved(folder, lambda: page.page.click("#save-path"))


def assembled(server, path: Path, folder: Path, extension: str = "exr") -> list[Path]:
    """Frames of a path on the array of a server."""
    target = folder / "frames" / f"frame.####.{extension}"
    complete("assemble", server.tiles.manifest.directory, path, "-o", target)
    return sorted(target.parent.iterdir())


def check_places(server, places: dict[Path, tuple[int, int]]) -> None:
    """Check that frames are the images of their places."""
    for frame, (c, l) in places.items():
        np.testing.assert_array_equal(read_image(frame), read_image(image_path(server.tiles.manifest, c, l)))


def test_a_drawn_path_is_played(browser, plain):
    with shown(browser, plain.url) as page:
        page.all_loaded()
        page.page.click("#draw")
        page.drag([(0, 0), (3, 2), (6, 0)], steps=10)
        page.page.click("#draw")
        page.page.locator("#seconds").fill("4")  # slow: a screen that lags leaves places out
        page.page.locator("#seconds").press("Enter")
        before = len(page.get("framearray.steps"))
        page.page.click("#play-path")
        page.wait("framearray.player.what === null")
        played = [(step["c"], step["l"]) for step in page.get("framearray.steps")[before:]]
        cameras = [c for c, _ in played]
        assert played[0] == (0, 0) and played[-1] == (6, 0)
        assert cameras == sorted(cameras) and set(cameras) == set(range(7))
        assert max(l for _, l in played) == 2
        page.page.click("#clear-path")
        assert page.page.locator("#play-path").is_disabled()
        page.check(plain.url)


def test_a_saved_path_holds_what_was_drawn(either, plain, tmp_path):
    with shown(either, plain.url) as page:
        page.page.keyboard.press("d")
        page.drag([(1, 1), (5, 3)], steps=20)
        page.page.click("#pad", position={"x": 2, "y": 2})  # straight to the first camera and light
        page.page.locator("#seconds").fill("4")
        page.page.locator("#seconds").press("Enter")
        path = tomllib.loads(saved(page, tmp_path).read_text())
        page.check(plain.url)
    *stroke, straight = path["segments"]
    assert path["fps"] == 24.0 and path["positions"] == "nearest"
    assert sum(segment["seconds"] for segment in path["segments"]) == pytest.approx(4.0, abs=2e-3)
    ends = {axis: [np.broadcast_to(one[axis], 2) for one in stroke] for axis in ("camera", "light")}
    camera, light = (np.array([moves[0][0], *(move[1] for move in moves)]) for moves in ends.values())
    np.testing.assert_allclose([camera[0], camera[-1]], [1, 5], atol=0.1)
    np.testing.assert_allclose([light[0], light[-1]], [1, 3], atol=0.1)
    # The pointer went straight from (1, 1) to (5, 3).
    np.testing.assert_allclose(light - 1, (camera - 1) / 2, atol=0.1)
    assert straight["camera"] == [camera[-1], 0] and straight["light"] == [light[-1], 0]


STROKE = """import("./path.js").then(({ Path }) => {
    const path = new Path(), samples = [];
    const hand = (s) => s < 2 ? [3 * s, 2 * s] : s < 3 ? [6, 4] : [6 - 2 * (s - 3) ** 2, 4];
    for (let k = 0; k <= 240; k++) {
        const s = k / 60, [c, l] = hand(s);
        samples.push({ s, c: c + 0.1 * Math.sin(50 * s), l });
    }
    path.addStroke(samples, {});
    const off = samples.map(({ s, c, l }) => [Math.abs(path.at(s).c - c), Math.abs(path.at(s).l - l)]);
    return { segments: path.segments, off: Math.max(...off.flat()) };
})"""


def test_a_drawn_path_has_few_keys(browser, plain):
    """A straight walk, a rest of a second, a curve: never more than half a position off."""
    with shown(browser, plain.url) as page:
        found = page.get(STROKE)
    walk, rest, *curve = found["segments"]
    assert found["off"] <= 0.5
    assert len(curve) <= 3
    assert walk["seconds"] == pytest.approx(2, abs=0.1)
    assert 0.9 <= rest["seconds"] <= 1.5, "the curve begins slowly"
    assert rest["camera"] == [walk["camera"][1]] * 2 and rest["light"] == [walk["light"][1]] * 2


def test_a_path_has_a_timeline(browser, plain):
    with shown(browser, plain.url) as page:
        for key in ("d", "Enter", "End", "Enter"):  # one second along all cameras
            page.page.keyboard.press(key)
        timeline = page.page.locator("#timeline")
        assert timeline.get_attribute("max") == "23"
        timeline.fill("12")
        assert page.place == (3, 0)
        assert page.get("document.getElementById('frame').value") == "frame 12 of 0-23"
        page.check(plain.url)


def test_assemble_takes_a_saved_path(browser, plain, tmp_path):
    with shown(browser, plain.url) as page:
        keyboard = page.page.keyboard
        for key in ("d", "Enter", "End", "Enter", "PageDown", "Enter"):  # a place at each corner but the last
            keyboard.press(key)
        file = saved(page, tmp_path)
        page.check(plain.url)
    frames = assembled(plain, file, tmp_path)
    assert len(frames) == 48
    check_places(plain, {frames[0]: (0, 0), frames[23]: (6, 0), frames[-1]: (6, 4)})


def test_assemble_takes_the_light_of_groups(browser, grouped, tmp_path):
    with shown(browser, f"{grouped.url}#axis.lamps=1") as page:
        page.page.locator("#group-lamps").fill("2.5")
        page.page.locator("#ambient-color").fill("#ff8800")
        for key in ("d", "Enter", "End", "Enter"):
            page.page.focus("#pad")
            page.page.keyboard.press(key)
        file = saved(page, tmp_path)
        pixels = page.pixels()
        page.check(grouped.url)
    assert tomllib.loads(file.read_text())["segments"][0]["axes"] == {"lamps": 1}
    last = read_codes(assembled(grouped, file, tmp_path, "png")[-1])
    assert np.abs(last - pixels.astype(float)).mean() < 1.0


def test_a_walk_by_keyboard_through_everything(browser, plain, tmp_path):
    """From the first Tab to a movie; only keys are pressed."""
    with shown(browser, plain.url) as page:
        press = page.page.keyboard.press

        def to(name):
            """Press Tab until an element has the focus."""
            for _ in range(40):
                if page.get(f"document.activeElement.matches('{name}')"):
                    return
                press("Tab")
            raise AssertionError(f"Tab does not reach {name}")

        def pressed(name):
            return page.get(f"document.querySelector('{name}').ariaPressed") == "true"

        def save(name, key="Enter"):
            to(name)
            return page.saved(tmp_path, lambda: press(key))

        to("#picture")
        press("z"), press("z")
        x = page.get("framearray.zoom.x")
        press("ArrowLeft")
        assert page.get("framearray.zoom.x") > x
        to("#fit"), press("Enter")
        assert page.get("framearray.zoom.scale") == 1
        to("#one-to-one"), press("Enter")
        assert page.get("framearray.zoom.scale * framearray.zoom.fit().each * devicePixelRatio") == pytest.approx(1)
        press("v")
        to("#full-screen"), press("Enter")
        page.wait("document.fullscreenElement?.id === 'stage'")
        press("f")
        page.wait("!document.fullscreenElement")
        to("#compare"), press("Enter")
        to("#split"), press("Home")
        assert page.get("framearray.compare.split") == 0
        to("#compare"), press(" ")
        page.wait("!framearray.compare.view")
        page.settle()
        assert save("#save-picture").name == "room.c0000.l000.png"
        assert save("#save-exr", " ").name == "room.c0000.l000.exr"
        to("#pad"), press("ArrowRight"), press("Shift+ArrowDown")
        assert page.place == (1, 4)
        for name in ("#play-camera", "#play-light"):
            to(name), press("Enter")
            assert pressed(name)
            press("Escape")
            assert not pressed(name)
        to("#speed"), press("ArrowDown")
        page.wait("framearray.player.speed === 2")
        to("#draw"), press("Enter")
        assert pressed("#draw")
        to("#pad")
        for key in ("Home", "PageUp", "Enter", "End", "Enter", "PageDown", "Enter"):
            press(key)
        to("#seconds")
        press("Control+a"), page.page.keyboard.type("4"), press("Enter")
        to("#play-path"), press("Enter")
        assert pressed("#play-path")
        press("Enter")
        to("#timeline"), press("End")
        assert page.place == (6, 4)
        file = save("#save-path")
        to("#clear-path"), press("Enter")
        assert page.get("framearray.path.isEmpty")
        to("[name=layer]:checked"), press("ArrowRight")
        assert page.get("framearray.view.show") == "obscurance"
        to("#exposure"), press("ArrowRight")
        assert page.get("framearray.view.exposure") == 0.1
        to("#link"), press("Enter")
        page.wait("document.getElementById('link').textContent !== 'Copy link'")
        assert page.page.url.endswith("#camera=6&light=4&show=obscurance&exposure=0.1")
        to("#reset"), press("Enter")
        assert page.get("framearray.view.show") == "picture"
        to("#help"), press("Enter")
        assert not page.get("document.getElementById('keys').hidden")
        page.check(plain.url)
    text = file.read_text()
    first = "seconds = 2.0\ncamera = [0, 6]\nlight = 0\n"
    assert text.count("[[segments]]") == 2 and first in text
    file.write_text(text.replace(first, "seconds = 1.0\ncamera = [3, 6]\nlight = 2\n"))  # by hand
    frames = assembled(plain, file, tmp_path)
    assert len(frames) == 72
    check_places(plain, {frames[0]: (3, 2), frames[23]: (6, 2), frames[-1]: (6, 4)})


LET_GO = """import("./path.js").then(({ Path }) => {
    const path = new Path();
    const samples = [...Array(21).keys()].map((k) => ({ s: k / 20, c: 1 + k / 5.25, l: 1 + k / 10.5 }));
    path.addStroke([...samples, { s: 3, c: 5, l: 3 }], {});
    return path.segments.map(({ camera }) => camera);
})"""


def test_a_drawn_path_ends_where_the_pointer_let_go(browser, plain):
    """The pointer waits for two seconds, a fifth of a position before its end."""
    with shown(browser, plain.url) as page:
        cameras = page.get(LET_GO)
    assert cameras[0][0] == 1 and cameras[-1] == [5, 5]
