"""One light at a time: photometric stereo finds the surface by what the files say; arrays of lights in the scene."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.boxarrays import look_at, plain_manifest, write_array

from framearray_cli.array.images import ImageFormat, read_codes, read_image, write_image, write_layers
from framearray_cli.array.manifest import (
    Manifest,
    ManifestCamera,
    ManifestLight,
    image_path,
    layers_path,
    matrix_rows,
)  # fmt: skip
from framearray_cli.array.manifest_toml import write_manifest
from framearray_cli.base.errors import JobError, OutputError
from framearray_cli.tools.export import SplitOptions, export_array
from framearray_cli.tools.mixing.mixer import SumOptions

ALBEDO, MIDDLE = 0.7, np.array([0.5, -0.2, 1.0])
SUNS = np.array([[0.2, -1.0, 0.3], [-0.6, -0.8, 0.1], [0.1, -0.7, -0.8], [0.7, -0.6, -0.2], [-0.2, -0.9, 0.6]])


def sphere_array(folder: Path, kind: str) -> tuple[Manifest, np.ndarray]:
    """A matte sphere of radius 1 far below an oblique camera, each light the only one, as closed forms.

    Returns:
        The array, and the normals of camera 0 in the scene (h, w, 3); 0 beside the sphere.
    """
    suns = SUNS / np.linalg.norm(SUNS, axis=1, keepdims=True)
    strengths = np.array([[2.0, 2.5, 3.0], [3.0, 2.0, 1.0], [1.5, 1.5, 1.5], [2.0, 1.0, 4.0], [1.0, 3.0, 2.0]])
    far = 1000.0  # radii: light of a point arrives in one direction
    sources = [
        {"type": "directional", "direction": sun.tolist(), "irradiance": strength.tolist()} if kind == "directional"
        else {"type": "point", "position": (MIDDLE - far * sun).tolist(), "intensity": (strength * far**2).tolist()}
        for sun, strength in zip(suns, strengths, strict=True)
    ]  # fmt: skip
    eye = look_at([3.0, 4.0, 5.0], MIDDLE, roll=0.4)
    base = plain_manifest(folder, extension="exr")
    manifest = replace(
        base,
        cameras=(ManifestCamera(world_from_camera=matrix_rows(eye), fov=60.0),),
        lights=tuple(
            ManifestLight(ambient=(0.0,) * 3, ambient_error=(0.0,) * 3, sources=(source,)) for source in sources
        ),
        job={"camera": {"keys": [{"target": MIDDLE.tolist()}]}},
    )
    width, height = manifest.resolution
    x, y = np.meshgrid((np.arange(width) + 0.5 - width / 2) / 18, (height / 2 - np.arange(height) - 0.5) / 18)
    inside = x**2 + y**2 < 0.98
    local = np.stack([x, y, np.sqrt(np.where(inside, 1 - x**2 - y**2, 0))], -1) * inside[..., None]
    normal = local @ eye[:3, :3].T
    for l, (sun, strength) in enumerate(zip(suns, strengths, strict=True)):
        shading = ALBEDO / np.pi * np.clip(-normal @ sun, 0, None)[..., None] * strength
        write_image(image_path(manifest, 0, l), shading.astype(np.float32), ImageFormat(half="never"))
    layers = {f"normal.{axis}": normal[..., k].astype(np.float32) for k, axis in enumerate("XYZ")}
    write_layers(layers_path(manifest, 0), {"depth.Z": (5.0 * inside).astype(np.float32)} | layers)
    write_manifest(folder, manifest)
    return manifest, normal


@pytest.mark.parametrize("kind", ["directional", "point"])
def test_photometric_stereo_finds_the_surface(tmp_path: Path, kind: str) -> None:
    """Least squares over lights that a pixel sees, as readers of such sets do it [Woodham80]: no file of ours helps."""
    array, normal = sphere_array(tmp_path / "out", kind)
    folder = export_array(array.directory, tmp_path / "x", "olat", image_format=ImageFormat(half="never", format="exr"))
    folder = folder.target / "c0000"
    names = (folder / "filenames.txt").read_text(encoding="utf-8").split()
    directions, strengths = np.loadtxt(folder / "light_directions.txt"), np.loadtxt(folder / "light_intensities.txt")
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1, atol=1e-8)
    seen = np.stack([read_image(folder / name) / strength for name, strength in zip(names, strengths, strict=True)])
    mask = read_codes(folder / "mask.png")[..., 0] == 255
    lit = mask & (seen.min(axis=(0, -1)) > 0)
    assert mask.sum() > 900 and lit.sum() > 150
    scaled = np.linalg.lstsq(directions, seen[:, lit].mean(-1), rcond=None)[0].T
    found = scaled / np.linalg.norm(scaled, axis=1, keepdims=True)
    stored = np.load(folder / "Normal_gt.npy")
    np.testing.assert_allclose(found, stored[lit], atol=2e-3)  # halves of layers; light of points is not quite parallel
    np.testing.assert_allclose(np.linalg.norm(scaled, axis=1), ALBEDO / np.pi, rtol=3e-3)
    assert stored[..., 2][mask].min() >= 0, "z points to the camera"
    pose = array.cameras[0].matrix[:3, :3]
    np.testing.assert_allclose(stored @ pose.T, normal, atol=1e-3)


def test_arrays_hold_the_lights_of_the_scene(tmp_path: Path) -> None:
    array = write_array(plain_manifest(tmp_path / "out"))
    folder = export_array(array.directory, tmp_path / "x", "olat", light="2,0").target
    np.testing.assert_array_equal(np.load(folder / "light_pos.npy"), [[0.0, 2.0, -0.5], [0.2, 2.0, -0.5]])
    np.testing.assert_array_equal(np.load(folder / "light_intensity.npy"), [[8.0, 7.0, 6.0], [10.0, 7.0, 6.0]])
    way = np.load(folder / "light_pos.npy")  # the middle is the origin, as the job says nothing
    np.testing.assert_allclose(np.load(folder / "light_dir.npy"), way / np.linalg.norm(way, axis=1, keepdims=True))
    table = json.loads((folder / "transforms.json").read_text(encoding="utf-8"))
    assert [(frame["camera"], frame["light"], frame["light_index"]) for frame in table["frames"]] == [
        (c, l, k) for c in range(4) for k, l in enumerate((0, 2))
    ]
    for frame in table["frames"]:
        assert frame["file_path"] == f"c{frame['camera']:04d}/l{frame['light']:03d}.png"
        own = read_codes(image_path(array, frame["camera"], frame["light"]))
        np.testing.assert_array_equal(read_codes(folder / frame["file_path"]), own)
        np.testing.assert_array_equal(frame["transform_matrix"], array.cameras[frame["camera"]].matrix)
    assert (folder / "c0000/filenames.txt").read_text(encoding="utf-8") == "l000.png\nl002.png\n"


def test_directional_lights_have_no_position_and_sets_their_own_files(tmp_path: Path) -> None:
    array, _ = sphere_array(tmp_path / "out", "directional")
    split = SplitOptions(rules=("light:test=3-4",))
    folder = export_array(array.directory, tmp_path / "x", "olat", split=split).target
    assert np.isnan(np.load(folder / "light_pos.npy")).all()
    names = {name: json.loads((folder / f"transforms_{name}.json").read_text())["frames"] for name in ("train", "test")}
    assert {name: [frame["light_index"] for frame in frames] for name, frames in names.items()} == {
        "train": [0, 1, 2], "test": [3, 4]
    }  # fmt: skip


def test_what_the_format_cannot_hold(tmp_path: Path) -> None:
    two = [replace(light, sources=light.sources * 2) for light in plain_manifest().lights]
    array = write_array(plain_manifest(tmp_path / "out", lights=two))
    with pytest.raises(
        OutputError, match=r"as light_dir\.npy has one direction per picture, got 2 at light position 0"
    ):
        export_array(array.directory, tmp_path / "x", "olat")
    (tmp_path / "w.csv").write_text("weight\n1\n1\n1\n")
    one = write_array(plain_manifest(tmp_path / "one", extension="exr"))
    with pytest.raises(JobError, match="another format than olat, as a sum of light has no direction"):
        export_array(one.directory, tmp_path / "x", "olat", sums=SumOptions(weights=tmp_path / "w.csv"))
