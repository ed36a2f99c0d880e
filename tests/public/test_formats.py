"""Frame arrays as lazy arrays of xarray and as stores of zarr, and what their data sets say of cameras and lights."""

import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import handmade
from support.boxarrays import grouped_manifest, light, write_groups

import framearray
from framearray_cli.array import images
from framearray_cli.array.manifest import Manifest, ManifestCamera, ManifestLight, image_path
from framearray_cli.array.manifest_toml import write_manifest


@pytest.fixture(scope="module")
def array(tmp_path_factory: pytest.TempPathFactory) -> framearray.FrameArray:
    return framearray.open(handmade.grouped(tmp_path_factory.mktemp("grouped")).directory)


def whole(array: framearray.FrameArray) -> np.ndarray:
    """All pictures, (camera, light, lamps, y, x, channel)."""
    n_c, n_l, n_lamps = array.shape[:3]
    pictures = [
        array.picture(c, {"light": l, "lamps": k}) for c in range(n_c) for l in range(n_l) for k in range(n_lamps)
    ]
    return np.array(pictures).reshape(array.shape)


def test_a_lazy_array_reads_what_is_asked_for(array: framearray.FrameArray, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("xarray", reason="an optional library")
    lazy, right = array.to_xarray(), whole(array)
    assert lazy.dims == ("camera", "light", "lamps", "y", "x", "channel") and lazy.shape == right.shape
    assert lazy.name == "radiance" and lazy.dtype == np.float32
    asked: list[tuple[int, dict[str, float]]] = []
    monkeypatch.setattr(
        framearray.FrameArray, "picture", lambda self, c, l: (asked.append((c, l)), right[c, l["light"], l["lamps"]])[1]
    )
    np.testing.assert_array_equal(lazy[1, 2, 0], right[1, 2, 0])
    assert asked == [(1, {"light": 2, "lamps": 0})]
    np.testing.assert_array_equal(lazy[1, 2, 0, 3:9, ::-2, 1], right[1, 2, 0, 3:9, ::-2, 1])
    asked.clear()
    part = lazy.isel(camera=[3, 0], light=slice(None, None, 2), lamps=1, y=5).sel(channel=["B", "R"])
    assert asked == []
    np.testing.assert_array_equal(part, right[[3, 0], ::2, 1, 5][..., [2, 0]])
    assert sorted(asked, key=str) == [(c, {"light": l, "lamps": 1}) for c in (0, 3) for l in (0, 2)]
    np.testing.assert_array_equal(lazy.transpose("y", ...)[7], right[:, :, :, 7])
    np.testing.assert_array_equal(lazy, right)


def test_a_lazy_array_can_be_pickled_and_names_what_a_sun_shines_at(
    array: framearray.FrameArray, tmp_path: Path
) -> None:
    pytest.importorskip("xarray", reason="an optional library")
    sun = array.manifest.groups[1]
    lights = tuple(
        replace(light, sources=({"type": "directional", "time": f"2026-06-21T{6 + l:02d}:30:00+02:00"},))
        for l, light in enumerate(sun.lights)
    )
    manifest = replace(array.manifest, groups=(array.manifest.groups[0], replace(sun, lights=lights)))
    write_manifest(tmp_path, manifest)
    lazy = pickle.loads(pickle.dumps(framearray.open(tmp_path).to_xarray()))
    assert lazy.time.dims == ("light",)
    np.testing.assert_array_equal(lazy.time[2], np.datetime64("2026-06-21T08:30"))
    summed = array.relight(weights=[0.2, 0.3, 0.5]).to_xarray(name="mixed")
    assert summed.shape[:3] == (4, 1, 2) and summed.name == "mixed" and "time" not in summed.coords


@pytest.mark.parametrize("dtype", ["float32", "float16"])
def test_a_store_holds_all_pictures_and_poses(array: framearray.FrameArray, tmp_path: Path, dtype: str) -> None:
    zarr = pytest.importorskip("zarr", reason="an optional library")
    relit = array.relight(groups={"sun": 0.5})
    relit.to_zarr(tmp_path / "store.zarr", dtype=dtype)
    store = zarr.open_group(tmp_path / "store.zarr", mode="r")
    pictures = store["radiance"]
    assert pictures.metadata.zarr_format == 3 and pictures.chunks == (1, 1, 1, 48, 64, 3)
    assert pictures.metadata.dimension_names == ("camera", "light", "lamps", "y", "x", "channel")
    np.testing.assert_array_equal(pictures[:], whole(relit).astype(dtype))
    np.testing.assert_array_equal(store["world_from_camera"][:], array.cameras.world_from_camera)
    np.testing.assert_array_equal(store["intrinsics"][:], array.cameras.intrinsics)
    assert store.attrs["fps"] == 24.0
    assert [path.name for path in tmp_path.iterdir()] == ["store.zarr"], "no temporary folder"


def test_a_store_appears_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("zarr", reason="an optional library")
    manifest = handmade.plain(tmp_path / "array", n_c=2, n_l=2, layers=False)
    array, target = framearray.open(tmp_path / "array"), tmp_path / "store.zarr"
    bright = handmade.soft(1, 1, top=1e5)
    images.write_image(image_path(manifest, 1, 1), bright, handmade.FLOAT)
    with pytest.raises(framearray.OutputError, match=r"picture \[1, 1\] has values above 65504"):
        array.to_zarr(target, dtype="float16")
    assert [path.name for path in tmp_path.iterdir()] == ["array"]
    array.to_zarr(target)
    with pytest.raises(framearray.OutputError, match="is there already; give another path, or overwrite=True"):
        array.to_zarr(target)
    array.relight(weights=[0.5, 0.5]).to_zarr(target, overwrite=True, threads=1)
    image_path(manifest, 0, 1).unlink()
    with pytest.raises(framearray.OutputError, match="images of camera 0 are missing; `framearray render JOB` goes on"):
        array.to_zarr(tmp_path / "other.zarr")
    with pytest.raises(ValueError, match="dtype: expected float32 or float16, got 'int8'"):
        array.to_zarr(target, dtype="int8")
    (tmp_path / "file").write_text("")
    with pytest.raises(framearray.OutputError, match="a file of that name is in the way"):
        array.to_zarr(tmp_path / "file")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["array", "file", "store.zarr"]


@pytest.mark.parametrize(
    ("library", "call", "message"),
    [
        ("xarray", lambda array: array.to_xarray(), r"lazy arrays need xarray, which is not installed.*\[xarray\]"),
        ("zarr", lambda array: array.to_zarr("nowhere.zarr"), r"stores need zarr, which is not installed.*\[zarr\]"),
    ],
)
def test_a_library_that_is_missing_is_named(array, library, call, message, monkeypatch) -> None:
    import sys

    for module in ("framearray.labelled", "framearray.zarrstore"):
        monkeypatch.delitem(sys.modules, module, raising=False)
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(framearray.MissingExtraError, match=message):
        call(array)


SPOT = {
    "type": "spot", "position": (0.5, 1.0, 2.0), "direction": (0.0, -1.0, 0.0), "intensity": (1.0, 2.0, 3.0),
    "inner": 10.0, "outer": 30.0,
}  # fmt: skip
SUN = {"type": "directional", "direction": (0.0, -1.0, 0.0), "irradiance": (3.0, 2.0, 1.0), "elevation": 40.0}
MESH = {"type": "mesh", "material": "Lamp", "radiance": (5.0, 5.0, 4.0), "two_sided": True}


def at(*sources: dict[str, Any]) -> ManifestLight:
    return ManifestLight(ambient=(0.1, 0.2, 0.3), ambient_error=(0.0,) * 3, sources=sources)


def opened(folder: Path, **changes: Any) -> framearray.FrameArray:
    """An array without groups, with other cameras or lights in its manifest."""
    manifest = replace(handmade.plain(folder, n_c=2, n_l=2, layers=False), **changes)
    write_manifest(folder, manifest)
    return framearray.open(folder)


@pytest.fixture
def grouped(tmp_path: Path) -> Manifest:
    return write_groups(grouped_manifest(tmp_path / "out"))


def test_sources_of_all_kinds(tmp_path: Path) -> None:
    pytest.importorskip("xarray", reason="an optional library")
    times = [SUN | {"time": f"2026-06-21T{hour:02d}:30:00+02:00"} for hour in (8, 9)]
    array = opened(tmp_path / "out", lights=(at(SPOT, times[0], MESH), at(SPOT, times[1])))
    data = array.to_dataset()
    assert data.light_type.values.tolist() == [["spot", "directional", "mesh"], ["spot", "directional", ""]]
    nothing = [np.nan] * 3
    np.testing.assert_array_equal(data.light_position[0], [[0.5, 1, 2], nothing, nothing])
    np.testing.assert_array_equal(data.light_direction[1], [[0, -1, 0], [0, -1, 0], nothing])
    np.testing.assert_array_equal(data.light_strength[0], [[1, 2, 3], [3, 2, 1], [5, 5, 4]])
    np.testing.assert_array_equal(data.light_outer[:, 0], [30, 30])
    np.testing.assert_array_equal(data.light_elevation[0], [np.nan, 40, np.nan])
    assert "light_width" not in data and set(data.light_group.values.ravel()) == {""}
    np.testing.assert_array_equal(data.time, np.array(["2026-06-21T08:30", "2026-06-21T09:30"], "datetime64[ns]"))
    np.testing.assert_array_equal(data.light_ambient[1], [0.1, 0.2, 0.3])
    np.testing.assert_array_equal(data.radiance[1, 1, 3], array.picture(1, 1)[3])


def test_every_axis_has_its_own_and_factors_count(grouped: Manifest) -> None:
    pytest.importorskip("xarray", reason="an optional library")
    array = framearray.open(grouped.directory)
    data = array.relight(groups={"sun": (0.5, 1.0, 2.0)}, ambient=3.0).to_dataset()
    np.testing.assert_array_equal(data.lamps_position[:, 0], [light(l).sources[0]["position"] for l in range(2)])
    np.testing.assert_array_equal(data.lamps_strength[1, 0], [9.0, 7.0, 6.0])
    np.testing.assert_array_equal(data.light_strength[2, 0], [1.5, 2.0, 2.0])
    np.testing.assert_allclose(data.light_ambient[2], [0.75, 1.2, 3.0])
    np.testing.assert_allclose(data.lamps_ambient[0], [1.5, 1.2, 0.9])
    assert (data.light_group == "sun").all() and (data.lamps_group == "lamps").all()
    summed = array.relight(weights=[0.2, 0.3, 0.5]).to_dataset()
    assert summed.sizes["light"] == 1 and "light_type" not in summed and "lamps_type" in summed


def test_lenses(tmp_path: Path) -> None:
    pytest.importorskip("xarray", reason="an optional library")
    one = handmade.cameras(1)[0]
    flat = ManifestCamera(world_from_camera=one.world_from_camera, type="orthographic", height=2.5, shift=(0.1, 0.0))
    data = opened(tmp_path / "out", cameras=(one, flat)).to_dataset()
    assert data.projection.values.tolist() == ["perspective", "orthographic"]
    np.testing.assert_array_equal(data.view_height, [np.nan, 2.5])
    np.testing.assert_array_equal(data.fov, [60.0, np.nan])
    np.testing.assert_array_equal(data["shift"], [[0, 0], [0.1, 0]])


@pytest.mark.parametrize("sources", [(), (SPOT,), ({"type": "unknown"},)])
def test_odd_sources_do_no_harm(sources: tuple[dict[str, Any], ...], tmp_path: Path) -> None:
    pytest.importorskip("zarr", reason="an optional library")
    array = opened(tmp_path / "out", lights=(at(*sources), at()))
    array.to_zarr(tmp_path / "store.zarr")


def test_a_store_reads_back_as_the_data_set(grouped: Manifest, tmp_path: Path) -> None:
    xarray = pytest.importorskip("xarray", reason="an optional library")
    pytest.importorskip("zarr", reason="an optional library")
    sun = grouped.groups[1]
    moved = [
        replace(one, sources=(one.sources[0] | {"time": f"2026-06-21T{6 + l:02d}:30:00+02:00"}, SPOT)[: 2 - l // 2])
        for l, one in enumerate(sun.lights)
    ]
    write_manifest(grouped.directory, replace(grouped, groups=(grouped.groups[0], replace(sun, lights=tuple(moved)))))
    array = framearray.open(grouped.directory)
    array.to_zarr(tmp_path / "store.zarr")
    store, data = xarray.open_zarr(tmp_path / "store.zarr"), array.to_dataset()
    assert set(store.variables) | {"channel"} == set(data.variables)
    for name, variable in store.variables.items():
        assert variable.dims == data[name].dims, name
        np.testing.assert_array_equal(variable.astype(data[name].dtype), data[name].variable, err_msg=name)
