"""Exports of one group of sources: its light, its lamps, its axis, and nothing of the others."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.boxarrays import grouped_manifest, plain_manifest, see, write_array, write_groups
from typer.testing import CliRunner

from framearray_cli.array.images import ImageFormat, read_image
from framearray_cli.array.manifest import Manifest, image_path
from framearray_cli.array.manifest_toml import write_manifest
from framearray_cli.base.errors import JobError, OutputError
from framearray_cli.cli.main import app
from framearray_cli.tools.export import EXPORT_KINDS, export_array

EXR = ImageFormat(format="exr", half="never")
TARGET = [0.1, 0.9, -0.4]


def write(folder: Path, job: dict[str, Any] | None = None) -> Manifest:
    return write_groups(replace(grouped_manifest(folder), job=job or {}))


@pytest.mark.parametrize(("group", "n", "share"), [("lamps", 2, 0.1), ("sun", 3, 0.3)])
def test_pictures_and_lights_are_those_of_the_group(group: str, n: int, share: float, tmp_path: Path) -> None:
    """Image l is the colours times its direct share and I_A, as `write_groups` has them; no light of the others."""
    array = write(tmp_path / "out")
    made = export_array(array.directory, tmp_path / "x", "olat", group=group, image_format=EXR)
    assert (made.n_cameras, made.n_lights, made.warnings) == (4, n, ())
    frames = json.loads((made.target / "transforms.json").read_text(encoding="utf-8"))["frames"]
    (own,) = (one for one in array.groups if one.name == group)
    vectors = np.load(made.target / ("light_pos.npy" if group == "lamps" else "light_dir.npy"))
    assert len(frames) == 4 * n and len(vectors) == n
    for frame in frames:
        l = frame["light" if group == "sun" else "light_lamps"]
        _, colour = see(array, frame["camera"])
        wanted = colour * (share + 0.05 * l + np.array([0.5, 0.4, 0.3 + 0.1 * l]))
        np.testing.assert_allclose(read_image(made.target / frame["file_path"]), wanted, rtol=2e-3)
        (source,) = frame["sources"]
        assert source["group"] == group and set(frame) & {"light", "light_lamps"} == {
            "light" if group == "sun" else "light_lamps"
        }
        at = own.lights[l].sources[0]
        way = np.array(at["position"]) if group == "lamps" else -np.array(at["direction"])
        found = vectors[frame["light_index"]]
        np.testing.assert_allclose(found, way if group == "lamps" else way / np.linalg.norm(way))


def test_directions_begin_at_the_middle_of_the_group(tmp_path: Path) -> None:
    """That of the dome among the sources of the group; the other group has a target of its own."""
    sources = [
        {"type": "dome", "group": "lamps", "target": TARGET},
        {"type": "dome", "group": "sun", "target": [9] * 3},
    ]
    array = write(tmp_path / "out", {"light": {"sources": sources}})
    folder = export_array(array.directory, tmp_path / "x", "olat", group="lamps").target
    way = np.load(folder / "light_pos.npy") - TARGET
    np.testing.assert_allclose(np.load(folder / "light_dir.npy"), way / np.linalg.norm(way, axis=1, keepdims=True))


@pytest.mark.parametrize("kind", EXPORT_KINDS)
def test_every_format_takes_a_group(kind: Any, tmp_path: Path) -> None:
    array = write(tmp_path / "out")
    made = export_array(array.directory, tmp_path / "x", kind, group="sun", light="0,2")
    assert (made.n_cameras, made.n_lights) == (4, 2)
    for file in made.target.rglob("*.json*"):
        assert "lamps" not in file.read_text(encoding="utf-8"), file


def test_whole_images_are_linked(tmp_path: Path) -> None:
    """With cells the file of a group is its picture; beside obscurances there is I_A R W."""
    array = write(tmp_path / "out", {"indirect": {"method": "cells"}})
    bare = tuple(replace(light, ambient=(0.0,) * 3) for light in array.groups[1].lights)
    array = replace(array, groups=(array.groups[0], replace(array.groups[1], lights=bare)))
    write_manifest(array.directory, array)
    options: dict[str, Any] = {"group": "sun", "image_format": EXR, "cameras": "0"}
    folder = export_array(array.directory, tmp_path / "x", "olat", **options).target
    assert (folder / "c0000/l001.exr").samefile(image_path(array, 0, 1, array.groups[1]))
    other = write(tmp_path / "obscurance")
    folder = export_array(other.directory, tmp_path / "y", "olat", **options).target
    assert not (folder / "c0000/l001.exr").samefile(image_path(other, 0, 1, other.groups[1]))


def test_the_background_is_left_out(tmp_path: Path) -> None:
    array = write(tmp_path / "out")
    options: dict[str, Any] = {"group": "sun", "image_format": EXR, "cameras": "0", "light": "1"}
    first = export_array(array.directory, tmp_path / "x", "olat", **options).target
    write_manifest(
        array.directory, replace(array, background_images="none.c{camera:04d}.exr", background_ambient=(1.0,) * 3)
    )
    second = export_array(array.directory, tmp_path / "y", "olat", **options).target
    np.testing.assert_array_equal(read_image(first / "c0000/l001.exr"), read_image(second / "c0000/l001.exr"))


@pytest.mark.parametrize("kind", ["olat", "rti"])
def test_the_refusal_names_the_option(kind: Any, tmp_path: Path) -> None:
    array = write(tmp_path / "out")
    with pytest.raises(
        OutputError, match="got 2 at light position 0, 0; --group lamps or sun exports the light of one"
    ):
        export_array(array.directory, tmp_path / "x", kind)


def test_unknown_groups(tmp_path: Path) -> None:
    with pytest.raises(JobError, match="--group: expected lamps, sun, got 'moon'"):
        export_array(write(tmp_path / "out").directory, tmp_path / "x", "olat", group="moon")
    plain = write_array(plain_manifest(tmp_path / "plain"))
    with pytest.raises(JobError, match="--group: expected none, as the array has no groups, got 'sun'"):
        export_array(plain.directory, tmp_path / "x", "olat", group="sun")


def test_the_command_takes_it(tmp_path: Path) -> None:
    array = write(tmp_path / "out")
    given = ["export", str(array.directory), "-f", "rti", "-o", str(tmp_path / "x"), "--group", "lamps", "--light", "1"]
    result = CliRunner().invoke(app, given)
    assert result.exit_code == 0, result.output
    assert "c0003_lamps001.png" in (tmp_path / "x/images/c0003.lp").read_text(encoding="utf-8")
