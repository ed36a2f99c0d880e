"""Hugging Face: an image folder with a card, which the library `datasets` reads back."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.boxarrays import plain_manifest, write_array
from support.making import export_array

from framearray_cli.array.images import ImageFormat, read_codes
from framearray_cli.array.manifest import Manifest, ManifestLight, image_path
from framearray_cli.array.manifest_toml import write_manifest
from framearray_cli.base.errors import JobError
from framearray_cli.tools.export.splits import SplitOptions

LIGHTS = [
    ({"type": "point", "position": [0.0, 2.0, -0.5], "intensity": [8.0, 7.0, 6.0], "radius": 0.1},),
    (
        {"type": "environment", "file": "sky.exr", "rotation": 90.0, "intensity": [1.0, 0.5, 0.25]},
        {"type": "rect", "position": [0.5, 2.0, -1.0], "direction": [0.0, -1.0, 0.0], "intensity": [4.0, 3.0, 2.0],
         "across": [1.0, 0.0, 0.0], "width": 0.5, "height": 0.25, "two_sided": False},
    ),
    ({"type": "directional", "direction": [0.6, -0.8, 0.0], "irradiance": [3.0, 2.0, 1.0], "angle": 0.53},),
]  # fmt: skip
OPTIONS = SplitOptions(rules=("test=3", "val=1"))


@pytest.fixture
def array(tmp_path: Path) -> Manifest:
    at = [ManifestLight(ambient=(0.0,) * 3, ambient_error=(0.0,) * 3, sources=sources) for sources in LIGHTS]
    return write_array(plain_manifest(tmp_path / "out", lights=at, layers=False))


def test_rows_have_the_same_columns(array: Manifest, tmp_path: Path) -> None:
    folder = export_array(array.directory, tmp_path / "x", "huggingface", split=OPTIONS).target
    keys, sources = set(), set()
    for name, n in (("train", 6), ("validation", 3), ("test", 3)):
        rows = [json.loads(line) for line in (folder / name / "metadata.jsonl").read_text().splitlines()]
        assert len(rows) == n and {row["file_name"] for row in rows} == {f.name for f in (folder / name).glob("*.png")}
        keys |= {tuple(row) for row in rows}
        sources |= {tuple(source) for row in rows for source in row["sources"]}
        for row in rows:
            given = [{key: value for key, value in source.items() if value is not None} for source in row["sources"]]
            assert given == list(LIGHTS[row["light"]])
    assert len(keys) == len(sources) == 1, "columns of tables want the same keys in every row"


def test_the_card_names_sets_and_columns(array: Manifest, tmp_path: Path) -> None:
    yaml = pytest.importorskip("yaml", reason="PyYAML is not installed")
    folder = export_array(array.directory, tmp_path / "x", "huggingface", split=OPTIONS).target
    _, head, text = (folder / "README.md").read_text(encoding="utf-8").split("---\n", 2)
    card = yaml.safe_load(head)
    assert (card["pretty_name"], card["license"], card["size_categories"]) == ("box", "unknown", ["n<1K"])
    assert card["configs"][0]["data_files"] == [
        {"split": name, "path": f"{name}/**"} for name in ("train", "validation", "test")
    ]
    row = json.loads((folder / "train/metadata.jsonl").read_text().splitlines()[0])
    assert all(f"`{column}`" in text for column in row if column != "file_name")


@pytest.mark.parametrize("options", [SplitOptions(), OPTIONS])
def test_the_library_reads_pictures_and_columns(array: Manifest, tmp_path: Path, options: SplitOptions) -> None:
    datasets = pytest.importorskip("datasets", reason="datasets is not installed")
    folder = export_array(array.directory, tmp_path / "x", "huggingface", split=options).target
    datasets.disable_progress_bars()
    read = datasets.load_dataset(str(folder), cache_dir=str(tmp_path / "cache"))
    wanted = {"train": 6, "validation": 3, "test": 3} if options.rules else {"train": 12}
    assert {name: len(rows) for name, rows in read.items()} == wanted
    for rows in read.values():
        for row in rows:
            c, l = row["camera"], row["light"]
            np.testing.assert_array_equal(np.asarray(row["image"]), read_codes(image_path(array, c, l)))
            np.testing.assert_array_equal(row["transform_matrix"], array.cameras[c].matrix)
            given = [{key: value for key, value in source.items() if value is not None} for source in row["sources"]]
            assert given == list(LIGHTS[l])


def test_cameras_of_several_types_have_the_same_columns(array: Manifest, tmp_path: Path) -> None:
    kinds = (*array.cameras[:3], replace(array.cameras[3], type="orthographic", fov=None, height=4.0))
    mixed = write_array(replace(array, cameras=array.cameras, directory=tmp_path / "mixed"))
    write_manifest(mixed.directory, replace(mixed, cameras=kinds))
    folder = export_array(mixed.directory, tmp_path / "x", "huggingface", light="0").target
    rows = [json.loads(line) for line in (folder / "train/metadata.jsonl").read_text().splitlines()]
    assert len({tuple(row) for row in rows}) == 1
    assert [row["camera_model"] for row in rows] == [None, None, None, "ORTHOPHOTO"]
    assert [row["camera_angle_x"] is None for row in rows] == [False, False, False, True]


def test_images_that_the_library_cannot_read_are_refused(array: Manifest, tmp_path: Path) -> None:
    with pytest.raises(JobError, match="--image-format: expected png or jpg for readers of huggingface, got exr"):
        export_array(array.directory, tmp_path / "x", "huggingface", image_format=ImageFormat(format="exr"))
