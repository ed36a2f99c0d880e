"""Exports of one light at a time: RTI and OLAT, their round trips through jobs, and single groups of sources."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from support import tiny
from support.boxarrays import grouped_manifest, light, look_at, plain_manifest, see, write_array, write_groups
from support.making import export_array
from support.movies import DARK
from support.program import complete

from framearray_cli.array.images import ImageFormat, read_codes, read_image, write_image, write_layers
from framearray_cli.array.manifest import Manifest, ManifestCamera, image_path, layers_path, matrix_rows
from framearray_cli.array.manifest_toml import write_manifest
from framearray_cli.base.arrays import Float64
from framearray_cli.base.errors import JobError, OutputError
from framearray_cli.job.job import Job
from framearray_cli.job.read import job_table, read_job
from framearray_cli.scene.paths.paths import lights
from framearray_cli.tools.export import EXPORT_KINDS

EYE, TARGET = [0.3, 1.2, 2.1], [-0.4, 0.9, -1.0]  # of camera 0 of the box


def read_rows(file: Path) -> Float64:
    return np.loadtxt(file, skiprows=1, usecols=(1, 2, 3))


def test_rows_of_the_lp(tmp_path: Path) -> None:
    write_array(plain_manifest(tmp_path / "out"))
    folder = export_array(tmp_path / "out", tmp_path / "rti", "rti", cameras="0,2", light="1-2").target / "images"
    assert sorted(file.name for file in folder.glob("*.lp")) == ["c0000.lp", "c0002.lp"]
    head, *rows = (folder / "c0002.lp").read_text(encoding="utf-8").splitlines()
    assert head == "2" and [row.split()[0] for row in rows] == ["c0002_l001.png", "c0002_l002.png"]
    assert all((folder / row.split()[0]).is_file() for row in rows)
    np.testing.assert_allclose(np.linalg.norm(read_rows(folder / "c0002.lp"), axis=1), 1, rtol=0, atol=1e-8)


def test_light_from_above_and_from_the_camera(tmp_path: Path) -> None:
    """What the format means by its axes, without our reader: z towards the camera, y up in the picture."""
    back = np.array(EYE) - TARGET
    sources = [{"type": "directional", "direction": d, "irradiance": [1.0] * 3} for d in ((-back).tolist(), [0, -1, 0])]
    manifest = write_array(plain_manifest(tmp_path / "out", lights=[replace(DARK, sources=(s,)) for s in sources]))
    export_array(manifest.directory, tmp_path / "rti", "rti")
    from_camera, from_above = read_rows(tmp_path / "rti" / "images" / "c0000.lp")
    np.testing.assert_allclose(from_camera, [0, 0, 1], atol=1e-8)
    assert from_above[1] > 0.9 and abs(from_above[0]) < 1e-8


@pytest.mark.parametrize("n", [0, 2])
def test_several_sources_are_refused(n: int, tmp_path: Path) -> None:
    manifest = write_array(plain_manifest(tmp_path / "out", lights=[light(l, n) for l in range(3)]))
    with pytest.raises(OutputError, match=f"expected one source per picture, .*, got {n} at light position 0"):
        export_array(manifest.directory, tmp_path / "rti", "rti")


SHINING = {"type": "mesh", "material": "Lamp", "radiance": [1.0] * 3, "two_sided": True}


@pytest.mark.parametrize(("n", "found"), [(0, "with a position or a direction, .*, got type 'mesh'"), (1, "got 2 at")])
def test_surfaces_that_shine_are_refused(n: int, found: str, tmp_path: Path) -> None:
    at = [light(l, n) for l in range(3)]
    with_mesh = [replace(each, sources=(*each.sources, SHINING)) for each in at]
    manifest = write_array(plain_manifest(tmp_path / "out", lights=with_mesh))
    with pytest.raises(OutputError, match=found):
        export_array(manifest.directory, tmp_path / "rti", "rti")


N = 12


def job_with(folder: Path, source: dict[str, Any]) -> Job:
    table = tiny.table() | {
        "scene": {"file": "a.glb"},
        "camera": {"keys": [{"frame": 0, "eye": EYE, "target": TARGET}]},
        "light": {"sources": [source]},
    }
    (folder / "job.toml").write_text(tomli_w.dumps(table), encoding="utf-8")
    return read_job(folder / "job.toml")


def exported(folder: Path, job: Job) -> Path:
    """Export the lights of a job as an array of the box has them; return the folder."""
    path = lights(job).sources[0]
    at = [replace(DARK, sources=(path.table(l),)) for l in range(len(path.vector))]
    write_array(replace(plain_manifest(folder / "out", lights=at), job=job_table(job)))
    export_array(folder / "out", folder / "rti", "rti", cameras="0")
    return folder / "rti"


@pytest.mark.parametrize(
    "source",
    [
        {"type": "directional", "irradiance": 3.0},
        {"type": "point", "intensity": 3.0, "scale": 2.5},
        {"type": "point", "intensity": 3.0, "scale": 0.5, "center": [7.0, -2.0, 0.5]},
    ],
    ids=["directions", "points", "points around a centre"],
)
def test_a_file_comes_back_as_it_was(tmp_path: Path, source: dict[str, Any]) -> None:
    rows = np.random.default_rng(1).normal(size=(N, 3))
    rows /= np.linalg.norm(rows, axis=1, keepdims=True)
    np.savetxt(tmp_path / "in.csv", rows, delimiter=",", header="x,y,z", comments="")
    folder = exported(tmp_path, job_with(tmp_path, source | {"file": "in.csv", "space": "camera"}))
    np.testing.assert_allclose(read_rows(folder / "images" / "c0000.lp"), rows, atol=2e-9)


@pytest.mark.parametrize("shape", ["hemisphere", "sphere"])
@pytest.mark.parametrize("kind", ["point", "directional"])
def test_a_dome_comes_back_from_its_lights(tmp_path: Path, shape: str, kind: str) -> None:
    """The directions begin at the target of the dome, wherever cameras look."""
    target, radius = [4.0, 1.0, -2.0], 1.5
    strength = {"intensity": 2.0} if kind == "point" else {"irradiance": 2.0}
    around = {"target": target, "radius": radius} if kind == "point" else {}
    job = job_with(tmp_path, {"type": "dome", "positions": N, "shape": shape, **around, **strength})
    folder, wanted = exported(tmp_path, job), lights(job).sources[0].vector
    (tmp_path / "again").mkdir()
    from_json = job_with(tmp_path / "again", {"type": kind, "file": str(folder / "lights.json"), **strength})
    np.testing.assert_allclose(lights(from_json).sources[0].vector, wanted, atol=1e-12)


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
    manifest = replace(
        plain_manifest(folder, extension="exr"),
        cameras=(ManifestCamera(world_from_camera=matrix_rows(eye), fov=60.0),),
        lights=tuple(replace(DARK, sources=(source,)) for source in sources),
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
    folder = export_array(array.directory, tmp_path / "x", "olat", split=("light:test=3-4",)).target
    assert np.isnan(np.load(folder / "light_pos.npy")).all()
    names = {name: json.loads((folder / f"transforms_{name}.json").read_text())["frames"] for name in ("train", "test")}
    assert {name: [frame["light_index"] for frame in frames] for name, frames in names.items()} == {
        "train": [0, 1, 2], "test": [3, 4]
    }  # fmt: skip


def test_what_the_format_cannot_hold(tmp_path: Path) -> None:
    two = [replace(light, sources=light.sources * 2) for light in plain_manifest().lights]
    array = write_array(plain_manifest(tmp_path / "out", lights=two))
    said = r"as light_dir\.npy has one direction per picture, got 2 at light position 0"
    with pytest.raises(OutputError, match=said):
        export_array(array.directory, tmp_path / "x", "olat")


EXR = ImageFormat(format="exr", half="never")
DOME = [0.1, 0.9, -0.4]


def write(folder: Path, job: dict[str, Any] | None = None) -> Manifest:
    return write_groups(replace(grouped_manifest(folder), job=job or {}))


@pytest.mark.parametrize(("group", "n", "share"), [("lamps", 2, 0.1), ("sun", 3, 0.3)])
def test_pictures_and_lights_are_those_of_the_group(group: str, n: int, share: float, tmp_path: Path) -> None:
    """Image l is the colours times its direct share and I_A, as `write_groups` has them; no light of the others."""
    array = write(tmp_path / "out")
    made = export_array(array.directory, tmp_path / "x", "olat", group=group, image_format=EXR)
    assert (made.result.cameras, made.result.lights, made.warnings) == (4, n, ())
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
        {"type": "dome", "group": "lamps", "target": DOME},
        {"type": "dome", "group": "sun", "target": [9] * 3},
    ]
    array = write(tmp_path / "out", {"light": {"sources": sources}})
    folder = export_array(array.directory, tmp_path / "x", "olat", group="lamps").target
    way = np.load(folder / "light_pos.npy") - DOME
    np.testing.assert_allclose(np.load(folder / "light_dir.npy"), way / np.linalg.norm(way, axis=1, keepdims=True))


@pytest.mark.parametrize("kind", EXPORT_KINDS)
def test_every_format_takes_a_group(kind: Any, tmp_path: Path) -> None:
    array = write(tmp_path / "out")
    made = export_array(array.directory, tmp_path / "x", kind, group="sun", light="0,2")
    assert (made.result.cameras, made.result.lights) == (4, 2)
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
    said = "got 2 at light position 0, 0; --group lamps or sun exports the light of one"
    with pytest.raises(OutputError, match=said):
        export_array(array.directory, tmp_path / "x", kind)


def test_unknown_groups(tmp_path: Path) -> None:
    with pytest.raises(JobError, match="--group: expected lamps, sun, got 'moon'"):
        export_array(write(tmp_path / "out").directory, tmp_path / "x", "olat", group="moon")
    plain = write_array(plain_manifest(tmp_path / "plain"))
    with pytest.raises(JobError, match="--group: expected none, as the array has no groups, got 'sun'"):
        export_array(plain.directory, tmp_path / "x", "olat", group="sun")


def test_the_command_takes_it(tmp_path: Path) -> None:
    array = write(tmp_path / "out")
    complete("export", array.directory, "-f", "rti", "-o", tmp_path / "x", "--group", "lamps", "--light", "1")
    assert "c0003_lamps001.png" in (tmp_path / "x/images/c0003.lp").read_text(encoding="utf-8")
