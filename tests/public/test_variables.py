"""Cameras and lights beside pictures: what data sets of xarray and stores of zarr say of them, against the manifest."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import handmade
from support.boxarrays import grouped_manifest, light, write_groups

import framearray
from framearray_cli.array.manifest import Manifest, ManifestCamera, ManifestLight
from framearray_cli.array.manifest_toml import write_manifest

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
