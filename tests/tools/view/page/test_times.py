"""Times of day on the page."""

from dataclasses import replace

from support import handmade
from support.browsers import shown
from support.movies import DARK

from framearray_cli.array.manifest import ManifestLight
from framearray_cli.array.manifest_toml import write_manifest
from framearray_cli.tools.view.show import open_server, open_tiles

WHERE = "document.getElementById('where').textContent"


def at(hour: int) -> ManifestLight:
    when = f"2026-06-{21 + hour // 24}T{hour % 24:02d}:30:00+02:00"
    angles = {"azimuth": 15.0 * (hour % 24), "elevation": 40.0 if hour == 8 else -5.0}
    return replace(DARK, sources=({"type": "directional", "time": when, **angles},))


def test_the_page_says_when(browser, tmp_path):
    manifest = handmade.plain(tmp_path / "study")
    manifest = replace(manifest, lights=tuple(at(8 * l) for l in range(manifest.n_lights)))
    write_manifest(manifest.directory, manifest)
    with (
        open_server(open_tiles(manifest.directory, None, 2)) as server,
        shown(browser, f"{server.url}#camera=2&light=1") as page,
    ):
        assert page.get(WHERE) == "camera 2 of 0-6, light 1 of 0-4, 2026-06-21\u00a008:30"
        assert page.page.locator("#sun").inner_text() == "sun in the south-east, 40\u00b0 high"
        at_x, at_y = (float(page.page.locator("#sun-at").get_attribute(name)) for name in ("cx", "cy"))
        assert at_x > 0 > -at_y, "on the right, below the middle"
        page.drag([(3, 3)])
        assert page.page.locator("#sun").inner_text() == "sun below the horizon, north"
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
