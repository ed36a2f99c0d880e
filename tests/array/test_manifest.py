"""Manifests, records of finished frames, and the coarse array: written, read, refused."""

import re
import sys
import time
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from filelock import FileLock
from support import ROOT, handmade

from framearray_cli.array.coarsearray import COARSE_FOLDER, coarse_folder, read_coarse, remove_left_coarse, write_coarse
from framearray_cli.array.manifest import (
    Manifest,
    ManifestCamera,
    ManifestLight,
    file_patterns,
    image_path,
    layers_path,
    matrix_rows,
)
from framearray_cli.array.manifest_toml import manifest_schema, read_manifest, to_toml, write_manifest
from framearray_cli.array.record import Entry, RecordedRun, RecordWriter, read_records, record_file
from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import fingerprint


def make_manifest(n_cameras: int = 3, n_lights: int = 2, **changes: Any) -> Manifest:
    rng = np.random.default_rng(0)
    images, layers = file_patterns("kitchen", n_cameras, n_lights, "exr")
    known: dict[str, Any] = {
        "version": "0.1.0",
        "name": "kitchen",
        "fingerprint": fingerprint(b"job", b"scene"),
        "images": images,
        "layers": layers,
        "resolution": (400, 300),
        "fps": 23.976,
        "cameras": tuple(
            ManifestCamera(world_from_camera=matrix_rows(rng.normal(0, 1e5, (4, 4))), fov=60.0)
            for _ in range(n_cameras)
        ),
        "lights": tuple(
            ManifestLight(
                ambient=(0.1 + l, 1e-17, 3e20),
                ambient_error=(0.001, 0.0, 0.002),
                sources=(
                    {"type": "point", "position": [1.0, 2.0, -0.3], "intensity": [10.0, 10.0, 9.0]},
                    {"type": "directional", "direction": [0.0, -1.0, 0.0], "irradiance": [3.0, 3.0, 3.0]},
                ),
            )
            for l in range(n_lights)
        ),
        "job": {"name": "kitchen", "seed": 0, "camera": {"keys": [{"frame": 0, "eye": [0.0, 1.6, 3.0]}]}},
        "scene": {"triangles": 12, "notes": ['a "quoted" note\nof two lines'], "dropped": {"non-finite": 3}},
        "summary": {"seconds": 12.5, "rays": 10**10},
    }
    return Manifest(**(known | changes))


def test_round_trip(tmp_path: Path) -> None:
    manifest = make_manifest()
    path = write_manifest(tmp_path, manifest)
    assert path == tmp_path / "manifest.toml"
    for place in (tmp_path, path):
        back = read_manifest(place)
        assert back == manifest
        assert back.directory == tmp_path
    assert read_manifest(tmp_path) != make_manifest(fps=24)


def test_the_file_has_the_documented_keys(tmp_path: Path) -> None:
    """Read the file as a program would that is written only from docs/reference/manifest.md."""
    manifest = make_manifest()
    table = tomllib.loads(write_manifest(tmp_path, manifest).read_text(encoding="utf-8"))
    assert table["format"] == 1
    assert table["version"] == "0.1.0"
    assert table["fingerprint"].startswith("sha256:")
    assert table["images"].format(camera=2, light=1) == "kitchen.c0002.l001.exr"
    assert table["layers"].format(camera=2) == "kitchen.layers.c0002.exr"
    assert table["resolution"] == [400, 300]
    assert (table["n_cameras"], table["n_lights"]) == (3, 2)
    assert table["job"] == manifest.job
    np.testing.assert_array_equal(table["cameras"][2]["world_from_camera"], manifest.cameras[2].matrix)
    assert table["cameras"][0]["fov"] == 60.0
    assert table["lights"][1]["ambient"] == [1.1, 1e-17, 3e20]
    assert [source["type"] for source in table["lights"][1]["sources"]] == ["point", "directional"]


def test_a_matrix_stands_on_one_line() -> None:
    lines = to_toml(make_manifest()).splitlines()
    assert sum(line.startswith("world_from_camera = [[") for line in lines) == 3


def test_numpy_values_paths_and_none_are_written(tmp_path: Path) -> None:
    summary = {"seconds": np.float64(0.5), "rays": np.int64(3), "mean": np.ones(2), "file": Path("a/b"), "none": None}
    light = replace(make_manifest().lights[0], sources=({"type": "point", "position": np.zeros(3)},))
    write_manifest(tmp_path, make_manifest(summary=summary, lights=(light, light)))
    back = read_manifest(tmp_path)
    assert back.summary == {"seconds": 0.5, "rays": 3, "mean": [1.0, 1.0], "file": "a/b"}
    assert back.lights[0].sources[0]["position"] == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("value", [[1.0, 2.0], 5.0, [1.0, 2.0, "x"], [1.0, 2.0, float("inf")]])
def test_a_source_has_vectors_of_three_numbers(tmp_path: Path, value: object) -> None:
    light = replace(make_manifest().lights[0], sources=({"type": "point", "intensity": value},))
    write_manifest(tmp_path, make_manifest(lights=(light, light)))
    with pytest.raises(OutputError, match=r"lights\[0\]: sources\[0\]\.intensity: expected 3 finite numbers, got"):
        read_manifest(tmp_path)


def test_a_full_array_is_written_fast(tmp_path: Path) -> None:
    manifest = make_manifest(192, 48)
    start = time.process_time()
    write_manifest(tmp_path, manifest)
    middle = time.process_time()
    assert read_manifest(tmp_path) == manifest
    assert middle - start < 0.1
    assert time.process_time() - middle < 1.0


def test_image_and_layers_paths(tmp_path: Path) -> None:
    manifest = make_manifest(directory=tmp_path)
    assert image_path(manifest, 2, 1) == tmp_path / "kitchen.c0002.l001.exr"
    assert layers_path(manifest, 0) == tmp_path / "kitchen.layers.c0000.exr"
    with pytest.raises(OutputError, match="without layers"):
        layers_path(make_manifest(layers=""), 0)


def test_file_names_sort_and_widen() -> None:
    images, layers = file_patterns("a{b}", 12000, 1200, "png")
    assert images.format(camera=7, light=3) == "a{b}.c00007.l0003.png"
    assert layers.format(camera=11999) == "a{b}.layers.c11999.exr"
    names = [images.format(camera=c, light=l) for c in (0, 9, 10, 11999) for l in (0, 9, 10, 1199)]
    assert names == sorted(names)


def test_a_fingerprint_depends_on_where_each_part_ends() -> None:
    assert fingerprint(b"job", b"scene") == fingerprint(b"job", memoryview(b"scene"))
    different = {fingerprint(b"job", b"scene"), fingerprint(b"jobs", b"cene"), fingerprint(b"jobscene"), fingerprint()}
    assert len(different) == 4


@pytest.mark.parametrize(
    "pattern",
    [
        "../a.c{camera:04d}.l{light:03d}.exr",
        "/tmp/a.c{camera:04d}.l{light:03d}.exr",
        "a/../../b.c{camera:04d}.l{light:03d}.exr",
        "..\\a.c{camera:04d}.l{light:03d}.exr",
        "C:a.c{camera:04d}.l{light:03d}.exr",
        "a.c{camera.__class__}.l{light:03d}.exr",
        "a.c{camera!r}.l{light:03d}.exr",
        "a.c{camera:>9999999999d}.l{light:03d}.exr",
        "a.c{0}.l{light:03d}.exr",
        "a.c{camera:04d.exr",
        "a.c{camera:04d}.exr",
        "a.l{light:04d}.exr",
        "",
    ],
)
def test_patterns_that_do_more_than_number_files_are_refused(tmp_path: Path, pattern: str) -> None:
    with pytest.raises(ValueError, match="images: "):
        make_manifest(images=pattern)
    text = to_toml(make_manifest()).replace('"kitchen.c{camera:04d}.l{light:03d}.exr"', repr(pattern))
    (tmp_path / "manifest.toml").write_text(text, encoding="utf-8")
    with pytest.raises(OutputError, match=r"manifest\.toml: images: "):
        read_manifest(tmp_path)


def test_a_pattern_may_leave_out_an_axis_of_length_one() -> None:
    assert make_manifest(1, 2, images="sub/a.{light}.png").images == "sub/a.{light}.png"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("format = 1", "format = 3", "format: expected 1, got 3; use a newer framearray"),
        ("format = 1", "", "format: expected 1, got none"),
        ("format = 1", f"format = {[[0]] * 300}", "format: expected 1, got a list of 300 values"),
        ("[job]", "[job]\nx" + ".a" * 100_000 + " = 1", r"line \d+: expected at most 6 keys with dots between them"),
        ("fps = 23.976", "fps = 0", "fps: expected a number from 0.01 to 1000, got 0"),
        ("fps = 23.976", "fps = nan", "fps: expected a number from 0.01 to 1000, got nan"),
        ("fps = 23.976", "fps = 5e-324", "fps: expected a number from 0.01 to 1000, got 5e-324"),
        ("fps = 23.976", f"fps = {10**400}", "fps: expected a number from 0.01 to 1000, got a number beyond 64 bits"),
        ("fps = 23.976", f"fps = {10**4299}0", "not valid TOML: .*digits"),
        ("fov = 60.0", f"fov = {10**400}", r"cameras\[0\]: fov: .*got a number beyond 64 bits"),
        ("ambient = [0.1, ", f"ambient = [{10**400}, ", r"lights\[0\]: ambient: .*got \[a number beyond 64 bits"),
        ("version = ", "version = 0xf" + "f" * 9999 + " # ", "version: expected text, got a number beyond 64 bits"),
        ("resolution = [\n    400,", "resolution = [\n    65536,", "resolution: .*from 1 to 65535, got .65536, 300."),
        ("fps = 23.976", "", "expected the keys fps, found none"),
        ("n_cameras = 3", "n_cameras = 4", "n_cameras: says 4, but 3 are listed"),
        ("resolution = [\n    400,\n    300,\n]", "resolution = 3", "resolution: expected 2 whole numbers from 1"),
        ("fov = 60.0", "fov = 180.0", r"cameras\[0\]: fov: expected degrees in \(0, 180\), got 180.0"),
        ("fov = 60.0", "", r"cameras\[0\]: expected the keys fov, found none"),
        ("world_from_camera = [[", "world_from_camera = [[1.0, ", r"cameras\[0\]: world_from_camera: expected 4 rows"),
        ("ambient = [0.1, ", "ambient = [inf, ", r"lights\[0\]: ambient: expected 3 finite numbers"),
        ('type = "point"', 'kind = "point"', r"lights\[0\]: sources: expected tables with a type"),
        ("[job]", "[[job]]", "job: expected a table"),
        ("name = ", "name ", "not valid TOML"),
    ],
)
def test_broken_manifests_say_what_is_wrong(tmp_path: Path, old: str, new: str, message: str) -> None:
    text = to_toml(make_manifest())
    assert old in text
    (tmp_path / "manifest.toml").write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(OutputError, match=rf"manifest\.toml: {message}") as caught:
        read_manifest(tmp_path)
    assert "\n" not in str(caught.value)


def test_missing_and_unreadable_manifests(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"manifest\.toml: no such file; expected the output folder"):
        read_manifest(tmp_path)
    with pytest.raises(OutputError, match="no such file"):
        read_manifest(tmp_path / "nowhere")
    with pytest.raises(
        OutputError, match=rf"expected the output folder of `framearray render`, such as {tmp_path}/out$"
    ):
        (tmp_path / "out").mkdir()
        (tmp_path / "out" / "manifest.toml").touch()
        read_manifest(tmp_path)
    with pytest.raises(OutputError, match=rf"nowhere: no such file; expected .*, such as {tmp_path}/out$"):
        read_manifest(tmp_path / "nowhere")
    (tmp_path / "jobs" / "out" / "a").mkdir(parents=True)
    (tmp_path / "jobs" / "out" / "a" / "manifest.toml").touch()
    with pytest.raises(OutputError, match=rf"manifest.toml: no such file; .*, such as {tmp_path}/jobs/out/a$"):
        read_manifest(tmp_path / "jobs")
    (tmp_path / "manifest.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(OutputError, match="expected UTF-8 text, got a binary file"):
        read_manifest(tmp_path)


def test_unknown_keys_are_ignored(tmp_path: Path) -> None:
    text = to_toml(make_manifest()).replace("format = 1", 'format = 1\nlater = "addition"')
    (tmp_path / "manifest.toml").write_text(text, encoding="utf-8")
    assert read_manifest(tmp_path) == make_manifest()


def test_every_key_of_the_schema_is_on_the_page() -> None:
    page = (ROOT / "docs" / "reference" / "manifest.md").read_text(encoding="utf-8")
    schema = manifest_schema()
    keys = {key for one in (schema, *schema["$defs"].values()) for key in one.get("properties", {})}
    assert {"world_from_camera", "ambient_images", "n_lights", "axis"} <= keys
    assert sorted(key for key in keys if not re.search(rf"`{key}`|^\[*{key}\]*\s", page, re.MULTILINE)) == []


@pytest.mark.skipif(sys.platform == "win32", reason="an open file cannot be removed there")
def test_removing_a_record_while_it_is_written_is_an_error(tmp_path):
    """Otherwise hours of finished frames would go unrecorded."""
    file = record_file(tmp_path, "0-3")
    with RecordWriter(file, "print", RecordedRun(cameras="0-3", processor="this one")) as record:
        record.add(Entry(c=0, lights=(0, 1), files={}), {}, 0.0)
        file.unlink()
        with pytest.raises(OutputError, match=r"0-3\.jsonl: was removed while it was written"):
            record.add(Entry(c=1, lights=(0, 1), files={}), {}, 0.0)


def test_a_line_that_is_torn_does_not_spoil_the_next(tmp_path, monkeypatch):
    file = record_file(tmp_path, "0-3")
    with RecordWriter(file, "print", RecordedRun(cameras="0-3", processor="this one")) as record:
        disk = record._file

        class BecomesFull:
            """Takes all but ten bytes, then none."""

            def write(self, data: memoryview) -> int:
                if len(data) == 10:
                    raise OSError(28, "No space left on device")
                return disk.write(data[: len(data) - 10])

            def close(self) -> None:
                disk.close()

        monkeypatch.setattr(record, "_file", BecomesFull())
        with pytest.raises(OutputError, match="No space left"):
            record.add(Entry(c=0, lights=(0, 1), files={}), {}, 0.0)
        monkeypatch.setattr(record, "_file", disk)
        record.add(Entry(c=1, lights=(0, 1), files={}), {}, 0.0)
    assert [entry.c for entry in read_records(tmp_path, "print").entries] == [1]


PLACES = {"light": [0, 3]}


def test_it_is_there_while_the_block_lasts(tmp_path):
    (tmp_path / "other").write_text("stays")
    with coarse_folder(tmp_path) as folder:
        assert folder == tmp_path / COARSE_FOLDER and read_coarse(tmp_path, "sha256:1") is None
        manifest = handmade.plain(folder, n_c=2, n_l=2, layers=False)
        found = write_coarse(folder, manifest, PLACES)
        assert read_coarse(tmp_path, "sha256:1") == found and found.places == PLACES
        assert read_coarse(tmp_path, "sha256:2") is None, "of another job"
        with coarse_folder(tmp_path) as second:
            assert second is None, "another run has one"
        remove_left_coarse(tmp_path)
        assert read_coarse(tmp_path, "sha256:1") == found, "a run that goes on keeps its own"
        (folder / "sub").mkdir()
        (folder / "sub" / "file").write_text("")
    assert [path.name for path in tmp_path.iterdir()] == ["other"]


def test_what_a_killed_run_left_is_removed(tmp_path):
    folder = tmp_path / COARSE_FOLDER
    manifest = handmade.plain(folder, n_c=2, n_l=2, layers=False)
    write_coarse(folder, manifest, PLACES)
    (folder / "lock").touch()
    assert read_coarse(tmp_path, "sha256:1"), "until then a page may show it"
    with FileLock(folder / "lock"):
        remove_left_coarse(tmp_path)
    assert folder.is_dir()
    remove_left_coarse(tmp_path)
    assert list(tmp_path.iterdir()) == []
    remove_left_coarse(tmp_path)


def test_a_link_is_not_followed(tmp_path):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "file").write_text("stays")
    (tmp_path / COARSE_FOLDER).symlink_to(tmp_path / "elsewhere")
    remove_left_coarse(tmp_path)
    assert (tmp_path / "elsewhere" / "file").read_text() == "stays"


def test_a_damaged_one_is_none(tmp_path):
    folder = tmp_path / COARSE_FOLDER
    manifest = handmade.plain(folder, n_c=2, n_l=2, layers=False)
    for places in ({"light": [0]}, {"lamp": [0, 1]}, {}):
        write_coarse(folder, replace(manifest, summary={}), places)
        assert read_coarse(tmp_path, "sha256:1") is None
    (folder / "manifest.toml").write_text("= nothing")
    assert read_coarse(tmp_path, "sha256:1") is None
