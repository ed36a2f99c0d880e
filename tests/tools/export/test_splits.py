"""Sets for training, validation and testing: sizes, seeds, rules, and what formats make of them."""

import json
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
from support.boxarrays import grouped_manifest, plain_manifest, write_array
from support.making import export_array

from framearray_cli.array.manifest import Manifest
from framearray_cli.base.errors import JobError
from framearray_cli.tools.export.splits import Splits, read_splits, shared_samples

CAMERAS, LIGHTS = range(40), [(l,) for l in range(12)]


@pytest.fixture(scope="module")
def long() -> Manifest:
    """A manifest without files: 40 cameras, 12 light positions."""
    short = plain_manifest()
    return replace(short, cameras=short.cameras * 10, lights=short.lights * 4)


def split(manifest: Manifest, *rules: str, seed: int = 0) -> Splits:
    found = read_splits(rules, seed, manifest, CAMERAS, LIGHTS)
    assert found is not None
    return found


def members(sets: dict[int, str] | object, name: str) -> list[int]:
    return [k for k, own in dict(sets).items() if own == name]  # type: ignore[call-overload]  # any mapping


@pytest.mark.parametrize(
    ("rule", "sizes"),
    [
        ("80/10/10", (32, 4, 4)),
        ("90/10", (36, 0, 4)),
        ("98/1/1", (38, 1, 1)),  # each set has one at least
        ("34/33/33", (14, 13, 13)),  # 13.6, 13.2, 13.2: the largest remainder
        ("camera=62.5/0/37.5", (25, 0, 15)),
    ],
)
def test_sizes_of_shares(long: Manifest, rule: str, sizes: tuple[int, ...]) -> None:
    counts = Counter(split(long, rule).cameras.values())
    assert tuple(counts[name] for name in ("train", "val", "test")) == sizes


def test_a_seed_draws_the_same_again_and_another_seed_others(long: Manifest) -> None:
    first, again, other = (split(long, "80/10/10", seed=seed).cameras for seed in (1, 1, 2))
    assert first == again != other
    assert members(split(long, "80/10/10").cameras, "test") == [2, 13, 17, 35]  # with every version of everything
    picked = Counter(k for seed in range(200) for k in members(split(long, "90/10", seed=seed).cameras, "test"))
    # each of 40 cameras is one of the 4 with probability 0.1: mean 20 of 200, standard deviation 4.24; 5 of these
    assert all(abs(picked[k] - 20) < 21.3 for k in CAMERAS) and sum(picked.values()) == 800


def test_rules_name_places(long: Manifest) -> None:
    found = split(long, "test=0-lastx8", "camera:val=4-lastx8")
    assert members(found.cameras, "test") == [0, 8, 16, 24, 32]
    assert members(found.cameras, "val") == [4, 12, 20, 28, 36]
    assert len(members(found.cameras, "train")) == 30
    only = split(long, "train=0-9", "test=20-29")
    assert sorted(only.cameras) == [*range(10), *range(20, 30)], "what no set names is left out"


def test_sets_share_neither_cameras_nor_lights(long: Manifest) -> None:
    """Both axes are divided: a picture belongs to a set where both agree, and is left out elsewhere."""
    found = split(long, "camera=80/10/10", "light=50/25/25")
    pictures = {(c, l): found.of(c, (l,)) for c in CAMERAS for l in range(12)}
    assert Counter(pictures.values()) == {"train": 32 * 6, "val": 4 * 3, "test": 4 * 3, None: 480 - 192 - 24}
    for axis in (0, 1):
        seen = {
            name: {place[axis] for place, own in pictures.items() if own == name} for name in ("train", "val", "test")
        }
        assert not seen["train"] & seen["val"] and not seen["train"] & seen["test"] and not seen["val"] & seen["test"]


def test_shared_samples_are_named(long: Manifest) -> None:
    job = {"reuse": {"n_r": 3}}
    assert "cameras up to 6 positions apart share samples (reuse.n_r = 3)" in shared_samples(split(long, "90/10"), job)
    assert shared_samples(split(long, "train=0-13", "test=20-39"), job) == ""
    assert "--split train=PLACES" in shared_samples(split(long, "train=0-14", "test=20-39"), job)
    assert shared_samples(split(long, "light=90/10"), job) == shared_samples(None, job) == ""


@pytest.mark.parametrize(
    ("rules", "message"),
    [
        (("half",), r'--split: expected shares such as 80/10/10 .*, got "half"; axes: camera, light'),
        (("80/10/5",), r"--split 80/10/5: expected shares that add up to 100, got 95"),
        (("100/0/0",), r"expected at least two sets on axis camera, got 1"),
        (("lamp=90/10",), r'got "lamp=90/10"; axes: camera, light'),
        (("exam=1",), r'got "exam=1"'),
        (("camera:test=90/10",), r"--split camera:test: expected places"),
        (("test=99",), r"--split test: expected one of 40 camera positions"),
        (("test=3,5", "val=5"), r"--split val: expected different places, got 5 in test too"),
        (("80/10/10", "test=0"), r'expected shares or places once per set, got "test=0" after --split 80/10/10'),
        (("90/10", "light=80/10/10"), r"expected the same sets on each axis, got no val on axis camera"),
        (("test=all",), r"expected the same sets on each axis|expected train and another set, got test"),
        (("train=all",), r"expected train and another set, got train"),
    ],
)
def test_rules_that_cannot_be_read(long: Manifest, rules: tuple[str, ...], message: str) -> None:
    with pytest.raises(JobError, match=message):
        split(long, *rules)


def test_groups_stand_for_their_axes() -> None:
    lights = [(l, k) for l in range(3) for k in range(2)]
    found = read_splits(("sun:test=2", "lamps:test=1"), 0, grouped_manifest(), range(4), lights)
    assert found is not None and found.lights == ({0: "train", 1: "train", 2: "test"}, {0: "train", 1: "test"})


def test_light_positions_that_are_not_exported_are_hinted_at(tmp_path: Path) -> None:
    array = write_array(plain_manifest(tmp_path / "out")).directory
    for rules, message in (
        (("50/50", "light=50/50"), r"--split light: .* 2 positions on axis light, got 1; --light all exports all 3$"),
        (("test=0", "light:test=2"), r"--split light:test: .*, got none; --light all exports all 3$"),
    ):
        with pytest.raises(JobError, match=message):
            export_array(array, tmp_path / "x", "nerfstudio", split=rules)
        export_array(array, tmp_path / "x", "nerfstudio", split=rules, light="all", force=True)
    grouped = grouped_manifest()
    n = grouped.axes["lamps"]
    with pytest.raises(JobError, match=rf"got 1; --at lamps=all exports all {n}$"):
        read_splits(("lamps=50/50",), 0, grouped, CAMERAS, [(0, 0), (1, 0)])


def test_formats_list_the_sets(tmp_path: Path) -> None:
    array = write_array(plain_manifest(tmp_path / "out", layers=False))
    options = ("test=1,3",)
    made = export_array(array.directory, tmp_path / "ns", "nerfstudio", split=options)
    assert made.result.sets == {"train": 2, "test": 2} and made.result.pictures == 4
    table = json.loads((tmp_path / "ns/transforms.json").read_text(encoding="utf-8"))
    listed = {name: [file[7:12] for file in table[f"{name}_filenames"]] for name in ("train", "val", "test")}
    assert listed == {"train": ["c0000", "c0002"], "val": ["c0001", "c0003"], "test": ["c0001", "c0003"]}
    files = [file for name in ("train", "test") for file in table[f"{name}_filenames"]]
    assert sorted(files) == [frame["file_path"] for frame in table["frames"]]
    export_array(array.directory, tmp_path / "colmap", "colmap", split=options, light="0,1")
    for name, cameras in (("train", "02"), ("val", "13"), ("test", "13")):
        files = (tmp_path / "colmap" / f"{name}_list.txt").read_text(encoding="utf-8").split()
        assert files == [f"c000{c}_l00{l}.png" for c in cameras for l in (0, 1)]
        assert all((tmp_path / "colmap/images" / file).is_file() for file in files)
    both = ("test=1,3", "light:test=2")
    folder = export_array(array.directory, tmp_path / "a", "huggingface", split=both).target
    found = {(file.parent.name, file.stem) for file in folder.glob("*/*.png")}
    wanted = {("train", f"c000{c}_l00{l}") for c in (0, 2) for l in (0, 1)}
    assert found == wanted | {("test", f"c000{c}_l002") for c in (1, 3)}, "pictures of no set are not written"


def test_reflectance_imaging_has_no_sets(tmp_path: Path) -> None:
    array = write_array(plain_manifest(tmp_path / "out", layers=False))
    with pytest.raises(JobError, match="--split: expected another format than rti, which has no sets"):
        export_array(array.directory, tmp_path / "x", "rti", split=("90/10",))
