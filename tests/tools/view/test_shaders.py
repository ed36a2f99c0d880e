"""Views that the page offers, as files: what OpenColorIO writes, the export, and what is refused."""

import json
from dataclasses import replace

import pytest
from support import handmade
from support.studio import NODES, SHAPER, write_studio

from framearray_cli.array.manifest_toml import write_manifest
from framearray_cli.base.errors import JobError
from framearray_cli.tools.display import SRGB, find_view
from framearray_cli.tools.view.index import PageViews, page_views
from framearray_cli.tools.view.show import open_tiles, write_page


def test_files_hold_the_shader_and_its_tables(tmp_path, monkeypatch):
    monkeypatch.setenv("OCIO", str(write_studio(tmp_path)))
    views = page_views([SRGB, find_view("Film"), find_view("Film")])
    assert [row["name"] for row in views.table] == ["srgb", "Film"] and "file" not in views.table[0]
    head = json.loads(views.files[views.table[1]["file"] + ".json"])
    assert "vec4 to_screen(vec4" in head["text"]
    assert [(table["size"], table["channels"], table["smooth"]) for table in head["tables"]] == [
        ([SHAPER, 1], 1, True),
        ([NODES] * 3, 3, True),
    ]
    assert len(views.files[views.table[1]["file"] + ".bin"]) == 4 * (SHAPER + 3 * NODES**3)
    assert page_views([find_view("aces")]).table[-1] == {"name": "srgb", "label": "sRGB"}, "always among them"
    assert page_views([]) == PageViews()


def test_an_export_holds_its_views_and_only_those(tmp_path):
    manifest = handmade.plain(tmp_path / "array", n_c=1, n_l=1, layers=False)
    for views in ([find_view("aces")], []):
        tiles = open_tiles(manifest.directory, None, 1, None, views)
        write_page(tiles, tmp_path / "page", threads=1, progress=lambda n: None)
        contents = json.loads((tmp_path / "page" / "contents.json").read_text())
        files = sorted(file.name for file in (tmp_path / "page").glob("views/*"))
        assert files == sorted(name.removeprefix("views/") for name in tiles.views.files)
        assert [row["name"] for row in contents.get("views", [])] == (["aces", "srgb"] if views else [])


def test_pictures_that_are_clipped_have_no_views(tmp_path):
    manifest = handmade.plain(tmp_path, n_c=1, n_l=1, layers=False)
    write_manifest(tmp_path, replace(manifest, images=manifest.images.replace(".exr", ".png")))
    with pytest.raises(JobError, match=r"--view: .*: its images are PNG, clipped at 1 already; render EXR for views"):
        open_tiles(tmp_path, None, 1, None, [find_view("aces")])
