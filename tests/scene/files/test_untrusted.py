"""Files that somebody else wrote: records, manifests and images in their place that never end, or lie elsewhere."""

import os
from pathlib import Path

import numpy as np
import pytest
from support import movies

from framearray_cli.array.images import check_image, read_image
from framearray_cli.array.integrity import find_damage
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.array.record import Entry, RecordedRun, RecordWriter, read_records, record_file, seal
from framearray_cli.base.errors import OutputError
from framearray_cli.base.openimage import last_row
from framearray_cli.engine.images.standard_error import standard_error

PRINT = "sha256:0"
GOOD = {"c": 0, "lights": [0, 2], "files": {"a.exr": [4, "0"]}, "hits": 1.0, "rays": {"native": 5}, "seconds": 2.0}


def write(folder: Path, *lines: dict) -> None:
    """A record of one session with lines sealed as the program seals them."""
    file = record_file(folder, "0-1")
    file.parent.mkdir(exist_ok=True)
    head = {"fingerprint": PRINT, "cameras": "0-1", "processor": "p"}
    file.write_bytes(b"\n".join(map(seal, (head, *lines))) + b"\n")


def test_a_good_line_counts(tmp_path: Path) -> None:
    write(tmp_path, GOOD)
    records = read_records(tmp_path, PRINT)
    assert records.entries == (Entry(c=0, lights=(0, 2), files={"a.exr": (4, "0")}, hits=1.0),)
    assert records.runs == (RecordedRun(cameras="0-1", processor="p", rays={"native": 5}, seconds=2.0),)


@pytest.mark.parametrize(
    "wrong",
    [
        {"lights": [0, 10**12]},
        {"lights": [-1, 2]},
        {"lights": [2, 0]},
        {"c": -1},
        {"c": 10**9},
        {"c": float("inf")},
        {"hits": 10**400},
        {"files": {"../secret": [4, "0"]}},
        {"files": {"/dev/zero": [0, "0"]}},
        {"files": {"a\\b": [0, "0"]}},
        {"files": {"a\0": [0, "0"]}},
        {"files": {"..": [0, "0"]}},
        {"files": {"": [0, "0"]}},
    ],
)
def test_a_line_that_no_render_writes_does_not_count(tmp_path: Path, wrong: dict) -> None:
    write(tmp_path, GOOD | wrong)
    assert read_records(tmp_path, PRINT).entries == ()


@pytest.mark.parametrize(
    "wrong", [{"rays": [1]}, {"rays": {"native": "x"}}, {"seconds": "x"}, {"seconds": []}, {"seconds": float("nan")}]
)
def test_rays_and_seconds_of_a_session_count_where_they_are_recorded(tmp_path: Path, wrong: dict) -> None:
    write(tmp_path, GOOD | wrong)
    records = read_records(tmp_path, PRINT)
    assert len(records.entries) == 1
    assert records.runs[0].rays == ({} if "rays" in wrong else {"native": 5})
    assert records.runs[0].seconds == (0.0 if "seconds" in wrong else 2.0)


def test_what_the_program_writes_is_what_it_reads(tmp_path: Path) -> None:
    entry = Entry(
        c=3, lights=(1, 4), files={"Ω é.exr": (1 << 40, "ab")}, hits=0.5, notes=("x",), errors={1: (1e-30, 2.0)}
    )
    with RecordWriter(record_file(tmp_path, "0-3"), PRINT, RecordedRun(cameras="0-3", processor="p")) as record:
        record.add(entry, {"native": 7}, 1.5)
    records = read_records(tmp_path, PRINT)
    assert records.entries == (entry,)
    assert records.runs == (RecordedRun(cameras="0-3", processor="p", rays={"native": 7}, seconds=1.5),)


@pytest.mark.skipif(os.name == "nt", reason="pipes and devices are no files there")
@pytest.mark.parametrize("kind", ["pipe", "device", "folder"])
def test_what_has_no_end_is_not_read(tmp_path: Path, kind: str) -> None:
    def place(path: Path) -> Path:
        path.parent.mkdir(exist_ok=True)
        if kind == "pipe":
            os.mkfifo(path)
        elif kind == "device":
            path.symlink_to("/dev/zero")
        else:
            path.mkdir()
        return path

    with pytest.raises(OutputError, match=r"expected a file, got a folder or a device|no such file"):
        read_manifest(place(tmp_path / "manifest.toml"))
    with pytest.raises(OutputError, match="expected a file, got a folder or a device"):
        place(record_file(tmp_path, "0-1"))
        read_records(tmp_path, PRINT)
    for name in ("a.png", "a.jpg", "a.exr", "a.tif"):
        path = place(tmp_path / name)
        with pytest.raises(OutputError, match=r"a\.\w+: (expected a file|no such file)"):
            read_image(path)
        with pytest.raises(OutputError, match=r"a\.\w+: (expected a file|no such file)"):
            check_image(path, (4, 4))
        assert name[-3:] in ("png", "jpg") or last_row(path) is None
        assert list(find_damage(tmp_path, {name: (0, "0")}, [name])) == [(name, "is no file")]


def test_a_whole_array_is_read(tmp_path: Path) -> None:
    """The checks above pass a good array."""
    manifest = movies.plain(tmp_path, 1, 1, "exr")
    assert read_manifest(tmp_path) == manifest
    check_image(tmp_path / "tiny.c0000.l000.exr", manifest.resolution)


def test_the_error_of_what_is_very_bright_is_finite() -> None:
    rng = np.random.default_rng(1)
    difference = rng.standard_normal((8, 9, 3)).astype(np.float32)
    hits = np.full((8, 9), 7, np.int32)
    plain = standard_error(difference, hits)
    assert np.array_equal(standard_error(difference * np.float32(2.0**100), hits), plain * np.float32(2.0**100))
    assert np.array_equal(standard_error(np.zeros_like(difference), hits), np.zeros_like(difference))
