"""Alpha, mattes and positions in files: as written, as resumed, as refused."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import handmade, tiny
from support.making import assemble_movie

from framearray_cli.array.images import read_alpha, read_image, read_layers
from framearray_cli.array.integrity import verify
from framearray_cli.array.manifest import image_path, layers_path
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.array.pictures import Pictures
from framearray_cli.base.errors import OutputError
from framearray_cli.render.identity import identity_of
from framearray_cli.render.memory import window_memory
from framearray_cli.render.pilots.warn import layer_warnings
from framearray_cli.render.render import render
from framearray_cli.tools.movie.look import Look
from framearray_cli.tools.movie.pathfile import Sweep

ALL = {"alpha": True, "position": True, "uv": True, "cryptomatte": True}


def job_in(folder: Path, output: Any, **changes: Any) -> tiny.Job:
    scene = tiny.save_glb(tiny.room_meshes(), folder / "room.glb")
    return tiny.job_of_file(scene, folder / "out", scene={"background": [0.3, 0.4, 0.5]}, output=output, **changes)


def test_files_of_an_array_with_all_of_it(tmp_path: Path) -> None:
    """Written in two runs; OpenEXR reads types and texts as meant."""
    render(job_in(tmp_path, ALL, camera=tiny.WALK), cameras=[0, 1])
    render(job_in(tmp_path, ALL, camera=tiny.WALK))
    manifest = read_manifest(tmp_path / "out")
    assert manifest.has_alpha and not verify(tmp_path / "out", 2, lambda done, total: None).wrong
    image, layers = image_path(manifest, 2, 1), layers_path(manifest, 2)
    alpha, channels = read_alpha(image), read_layers(layers)
    assert alpha is not None and 0 == alpha.min() < alpha.max() == 1
    assert not read_image(image)[alpha == 0].any()
    kinds = ("CryptoObject", "CryptoMaterial")
    for kind in kinds:
        covered = sum(channels[f"{kind}{level:02d}.{letter}"] for level in range(3) for letter in "GA")
        np.testing.assert_allclose(covered, alpha, atol=2.0**-11)
    depth, eye = channels["depth.Z"], manifest.cameras[2].matrix
    position = np.stack([channels[f"position.{axis}"] for axis in "XYZ"], axis=-1)
    along = (position - eye[:3, 3]) @ -eye[:3, 2]
    np.testing.assert_allclose(along[alpha > 0], depth[alpha > 0], rtol=1e-5)  # without reuse, means of the same hits
    assert not position[alpha == 0].any()

    openexr = pytest.importorskip("OpenEXR", reason="the second reader of EXR is not installed")
    file = openexr.File(str(layers), separate_channels=True)
    header, types = file.header(), {name: channel.pixels.dtype for name, channel in file.channels().items()}
    assert header["colorInteropID"] == "data"
    assert openexr.File(str(image)).header()["colorInteropID"] == "lin_rec709_scene"
    names = {header[name]: name.split("/")[1] for name in header if name.endswith("/name")}
    assert set(names) == set(kinds)
    materials = json.loads(header[f"cryptomatte/{names['CryptoMaterial']}/manifest"])
    assert list(materials) == [material.name for material in tiny.MATERIALS]
    wide = [name for name in types if name.startswith(("Crypto", "position", "uv"))]
    assert len(wide) == 2 * 12 + 3 + 2 and {types[name] for name in wide} == {np.dtype("float32")}


def test_other_keys_are_another_array(tmp_path: Path) -> None:
    render(job_in(tmp_path, {}))
    for key in ALL:
        with pytest.raises(OutputError, match=rf"output\.{key}: nothing there, true now"):
            render(job_in(tmp_path, {key: True}))


def test_names_count_only_with_mattes() -> None:
    inputs = [tiny.prepared(tiny.job(output=output)) for output in ({}, {"alpha": True}, {"cryptomatte": True})]
    plain, alpha, mattes = (identity_of(each).fingerprint for each in inputs)
    assert plain == alpha != mattes


def test_texture_coordinates_of_a_scene_without_are_a_warning() -> None:
    job = tiny.job(output={"uv": True})
    (warning,) = layer_warnings(job, tiny.scene_of(tiny.box((-1, -1, -1), (1, 1, 1))))
    assert warning.startswith("output.uv: the scene has no texture coordinates")
    assert not list(layer_warnings(job, tiny.room())) and not list(layer_warnings(tiny.job(), tiny.room()))


def test_estimates_grow() -> None:
    plain, more = tiny.job(camera=tiny.WALK), tiny.job(camera=tiny.WALK, output=ALL)
    assert window_memory(tiny.prepared(more), 3) > window_memory(tiny.prepared(plain), 3)


@pytest.mark.parametrize(
    ("output", "problem"),
    [
        ({"alpha": True, "format": "jpg"}, 'expected format = "exr", "png" or "tif"'),
        ({"uv": True, "layers": False}, "expected layers = true next to it"),
        ({"cryptomatte": True, "layers": False}, "expected layers = true next to it"),
    ],
)
def test_what_does_not_go_together_is_refused(output: Any, problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        tiny.job(output=output)


@pytest.mark.parametrize("suffix", ["png", "tif"])
def test_other_formats(tmp_path: Path, suffix: str) -> None:
    render(job_in(tmp_path, {"alpha": True, "format": suffix}))
    image = image_path(read_manifest(tmp_path / "out"), 0, 0)
    alpha = read_alpha(image)
    assert alpha is not None and alpha.min() == 0 and alpha.max() == 1
    assert not read_image(image)[alpha == 0].any() and read_image(image).max() > 0.1


def test_one_file_per_frame_with_all_layers(tmp_path: Path) -> None:
    """The picture is the sum of its layers of light; mattes and their names come along."""
    openexr = pytest.importorskip("OpenEXR", reason="the second reader of EXR is not installed")
    sources = [{**source, "group": name} for name, source in (("sun-1", tiny.SUN), ("lamp", tiny.RED))]
    render(job_in(tmp_path, ALL, light={"frames": 2, "sources": sources}))
    sweep = Sweep(cameras="0", light="0-1")
    assemble_movie(tmp_path / "out", sweep, tmp_path / "frames" / "a.####.exr", layered=True)
    pictures = Pictures(read_manifest(tmp_path / "out"))
    file = openexr.File(str(tmp_path / "frames" / "a.0001.exr"), separate_channels=True)
    found = {name: channel.pixels.astype(np.float32) for name, channel in file.channels().items()}
    light = {name.rpartition(".")[0] for name in found if name.startswith("light_")}
    assert light == {"light_sun_1", "light_lamp", "light_ambient", "light_background"}
    picture = pictures.picture(0, [1])
    for k, letter in enumerate("RGB"):
        np.testing.assert_allclose(found[letter], picture[..., k], rtol=2.0**-10, atol=1e-6)
        total = sum(found[f"{name}.{letter}"] for name in light)
        np.testing.assert_allclose(found[letter], total, rtol=0, atol=2.0**-9 * picture.max())
    np.testing.assert_allclose(found["A"], pictures.alpha(0), atol=2.0**-11)
    layers = read_layers(layers_path(pictures.manifest, 0))
    assert all((found[name] == layers[name]).all() for name in layers)
    texts = openexr.File(str(layers_path(pictures.manifest, 0))).header()
    assert {name: file.header()[name] for name in texts if name.startswith("cryptomatte/")} == {
        name: text for name, text in texts.items() if name.startswith("cryptomatte/")
    }
    with pytest.raises(OutputError, match=r"expected frame\.####\.exr with --layers"):
        assemble_movie(tmp_path / "out", sweep, tmp_path / "frames" / "a.####.png", layered=True)
    layers_path(pictures.manifest, 0).unlink()
    with pytest.raises(OutputError, match=r"1 of 1 file of layers is missing; the first is .*; `framearray render"):
        assemble_movie(tmp_path / "out", sweep, tmp_path / "more" / "a.####.exr", layered=True)
    assert not (tmp_path / "more").exists()


def test_an_array_that_has_no_layers_is_refused(tmp_path: Path) -> None:
    handmade.plain(tmp_path / "out", n_c=1, n_l=2, layers=False)
    with pytest.raises(OutputError, match="out: expected layers or groups of lights for --layers, found neither"):
        assemble_movie(tmp_path / "out", Sweep(kind="light"), tmp_path / "a.####.exr", layered=True)


def test_sequences_keep_alpha(tmp_path: Path) -> None:
    render(job_in(tmp_path, {"alpha": True}))
    for name in ("a.####.png", "a.####.tif"):
        sweep = Sweep(cameras="0", light="0-1")
        assemble_movie(tmp_path / "out", sweep, tmp_path / name, look=Look(exposure=-1.0 if "png" in name else 0.0))
        made, source = tmp_path / name.replace("####", "0001"), image_path(read_manifest(tmp_path / "out"), 0, 1)
        np.testing.assert_allclose(read_alpha(made), read_alpha(source), atol=0.003)
        dimmed = read_image(source) * (0.5 if "png" in name else 1.0)
        np.testing.assert_allclose(read_image(made), np.minimum(dimmed, 1 if "png" in name else np.inf), atol=0.01)
