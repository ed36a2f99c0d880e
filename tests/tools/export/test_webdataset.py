"""WebDataset: shards that the library `webdataset` reads back."""

import io
import json
import tarfile
from pathlib import Path

import numpy as np
import pytest
from support.boxarrays import grouped_manifest, plain_manifest, write_array, write_groups
from support.making import export_array

from framearray_cli.array.images import ImageFormat, read_codes
from framearray_cli.array.manifest import Manifest, image_path
from framearray_cli.array.pictures import Pictures
from framearray_cli.base.colour import srgb8_from_linear
from framearray_cli.tools.export.splits import SplitOptions


@pytest.fixture
def array(tmp_path: Path) -> Manifest:
    return write_array(plain_manifest(tmp_path / "out", layers=False))


def members(file: Path) -> list[str]:
    with tarfile.open(file) as shard:
        return shard.getnames()


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # the library leaves shards open
def test_the_library_reads_every_picture_with_its_camera_and_light(array: Manifest, tmp_path: Path) -> None:
    wds = pytest.importorskip("webdataset", reason="webdataset is not installed")
    folder = export_array(array.directory, tmp_path / "x", "webdataset", per_shard=5).target
    shards = sorted(str(file) for file in folder.glob("*.tar"))
    assert len(shards) == 3
    read = wds.WebDataset(shards, shardshuffle=False).decode("rgb8")
    found = list(read)
    assert [sample["__key__"] for sample in found] == [f"c{c:04d}_l{l:03d}" for c in range(4) for l in range(3)]
    for sample in found:
        c, l = sample["json"]["camera"], sample["json"]["light"]
        np.testing.assert_array_equal(sample["png"], read_codes(image_path(array, c, l)))
        np.testing.assert_array_equal(sample["json"]["transform_matrix"], array.cameras[c].matrix)
        assert sample["json"]["sources"] == [
            {"type": "point", "position": [0.1 * l, 2.0, -0.5], "intensity": [8.0 + l, 7.0, 6.0]}
        ]
        assert (sample["json"]["w"], sample["json"]["fl_x"]) == (60, pytest.approx(20 * 3**0.5))


def test_shards_hold_a_number_of_samples_and_one_set(array: Manifest, tmp_path: Path) -> None:
    options = SplitOptions(rules=("test=1",))
    folder = export_array(array.directory, tmp_path / "x", "webdataset", split=options, per_shard=4).target
    assert sorted(file.name for file in folder.iterdir()) == [
        "shards.json", "test-000000.tar", "train-000000.tar", "train-000001.tar", "train-000002.tar"
    ]  # fmt: skip
    assert members(folder / "train-000002.tar") == ["c0003_l002.png", "c0003_l002.json"]
    assert {name[:5] for name in members(folder / "test-000000.tar")} == {"c0001"}
    index = json.loads((folder / "shards.json").read_text(encoding="utf-8"))
    assert index["sets"]["train"] == [{"file": f"train-00000{k}.tar", "samples": n} for k, n in enumerate((4, 4, 1))]
    for shards in index["sets"].values():
        assert all(len(members(folder / shard["file"])) == 2 * shard["samples"] for shard in shards)


def test_equal_arrays_give_equal_shards(array: Manifest, tmp_path: Path) -> None:
    data = [
        (export_array(array.directory, tmp_path / name, "webdataset").target / "all-000000.tar").read_bytes()
        for name in ("a", "b")
    ]
    assert data[0] == data[1]
    assert image_path(array, 0, 0).is_file(), "pictures are moved into tar files, those of the array stay"


def test_sums_of_groups_and_other_images(tmp_path: Path) -> None:
    array = write_groups(grouped_manifest(tmp_path / "out"))
    jpeg = ImageFormat(format="jpg", exposure=1.0)
    folder = export_array(array.directory, tmp_path / "x", "webdataset", cameras="2", image_format=jpeg).target
    with tarfile.open(folder / "all-000000.tar") as shard:
        assert shard.getnames()[:2] == ["c0002_l000_lamps000.jpg", "c0002_l000_lamps000.json"]
        table = json.load(io.BytesIO(shard.extractfile("c0002_l001_lamps001.json").read()))
        (tmp_path / "a.jpg").write_bytes(shard.extractfile("c0002_l001_lamps001.jpg").read())
    assert (table["light"], table["light_lamps"], table["exposure"]) == (1, 1, 1.0)
    assert [source["group"] for source in table["sources"]] == ["lamps", "sun"]
    expected = srgb8_from_linear(2 * Pictures(array).picture(2, (1, 1))).astype(int)
    assert np.abs(read_codes(tmp_path / "a.jpg") - expected).mean() < 2  # JPEG
