"""Files that a scene names: read beside it, refused elsewhere, and never more than there is memory for."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
from fuzz.sceneseeds import picture
from support.scenes import QUAD_UVS, Glb, made_png, png, write_obj

from framearray_cli.base.errors import SceneError
from framearray_cli.scene.files import read_meshes, read_stage
from framearray_cli.scene.files.assets import AssetError, Assets, Limit

IMAGE = png(np.full((2, 2, 3), 200, np.uint8))
OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl Paint\nf 1/1 2/2 3/3\n"
# ways to name ../secret.png from the folder of a scene
OUTSIDE = (
    "../secret.png",
    "..\\secret.png",
    "a/../../secret.png",
    "%2e%2e/secret.png",
    "..%2fsecret.png",
    "%2e%2e%5csecret.png",
    '"../secret.png"',
    "{root}/secret.png",
    "file://{root}/secret.png",
    "FILE:{root}/secret.png",
    "link.png",
    "library/secret.png",
    "loop/../../secret.png",
    "/dev/zero",
)
FOREIGN = (
    "C:\\pictures\\secret.png",
    "c:/pictures/secret.png",
    "\\\\server\\share\\secret.png",
    "//server/share/secret.png",
    "file://server/share/secret.png",
    "https://example.com/secret.png",
    "ftp://example.com/secret.png",
    "smb://server/secret.png",
    "/home/somebody/secret.png",
    "../gone.png",
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder for a scene: links in it lead out of it, and a picture beside it must not be read."""
    folder = tmp_path / "scene"
    (folder / "tex").mkdir(parents=True)
    (folder / "tex" / "a b.png").write_bytes(IMAGE)
    (tmp_path / "secret.png").write_bytes(IMAGE)
    (folder / "link.png").symlink_to(tmp_path / "secret.png")
    (folder / "library").symlink_to(tmp_path)
    (folder / "loop").symlink_to("loop")
    return folder


def obj(folder: Path, texture: str) -> Path:
    """An OBJ whose material has a texture."""
    return write_obj(folder, OBJ, f"newmtl Paint\nKd 1 1 1\nmap_Kd {texture}\n")


def gltf(folder: Path, uri: str | None = None, buffer: str | None = None) -> Path:
    """A glTF with an image or a buffer elsewhere."""
    glb = Glb()
    glb.add("textures", {"source": glb.add("images", {"uri": uri or "tex/a b.png"})})
    glb.node(glb.mesh(glb.material("Paint", {"baseColorTexture": {"index": 0}}), TEXCOORD_0=glb.accessor(QUAD_UVS)))
    (folder / "a.bin").write_bytes(glb.blob)
    glb.tree["buffers"] = [{"byteLength": len(glb.blob), "uri": buffer or "a.bin"}]
    file = folder / "a.gltf"
    file.write_text(json.dumps(glb.tree))
    return file


@pytest.mark.parametrize(
    "name", ["tex/a b.png", "tex\\a b.png", "./tex/a%20b.png", '"tex/a b.png"', "../scene/tex/a b.png"]
)
def test_what_lies_beside_a_scene_is_read(folder: Path, name: str) -> None:
    assert Assets(folder=folder).read(name) == IMAGE
    (folder.parent / "way").symlink_to(folder)  # the folder itself may be a link
    assert Assets(folder=folder.parent / "way").read(name.replace("../scene/", "")) == IMAGE


@pytest.mark.parametrize(
    "name", ["/home/somebody/a b.png", "D:\\textures\\a b.png", "../../tex/a b.png", "file:///x/a b.png"]
)
def test_a_file_of_that_name_beside_the_scene_is_taken_for_one_elsewhere(folder: Path, name: str) -> None:
    (folder / "a b.png").write_bytes(b"beside")
    assert Assets(folder=folder).read(name) == b"beside"


def knows_case(folder: Path) -> bool:
    (folder / "case").touch()
    return not (folder / "CASE").exists()


@pytest.mark.parametrize("name", ["Tex/A B.png", "tex\\a b.PNG", "D:\\Pictures\\Paint.png"])
def test_names_that_differ_in_case_only_are_found_with_a_note(folder: Path, name: str) -> None:
    if not knows_case(folder):
        pytest.skip("names on this disk have no case")
    (folder / "paint.PNG").write_bytes(IMAGE)
    file = obj(folder, name)
    (folder / "a.mtl").rename(folder / "A.MTL")
    found = read_meshes(file)
    assert len(found.textures) == 1
    disk = "paint.PNG" if "Paint" in name else "tex/a b.png"
    assert found.notes == (
        f"names of files differ in upper and lower case only: a.mtl (A.MTL on the disk), {name} ({disk} on the disk)",
    )
    glb = gltf(folder, name, "A.Bin")
    assert len(read_meshes(glb).textures) == 1
    assert read_stage(glb).notes == ("names of files differ in upper and lower case only: A.Bin (a.bin on the disk)",)


def test_an_exact_name_counts_before_one_in_another_case(folder: Path) -> None:
    if not knows_case(folder):
        pytest.skip("names on this disk have no case")
    (folder / "TEX").mkdir()
    (folder / "TEX" / "A B.PNG").write_bytes(b"other")
    assets = Assets(folder=folder)
    assert assets.read("tex/a b.png") == IMAGE and assets.renamed == {}
    with pytest.raises(AssetError, match="no such file"):
        assets.read("Library/secret.png")  # a link that leads out, in another case
    assert assets.renamed == {}


@pytest.mark.parametrize("name", OUTSIDE)
def test_what_lies_elsewhere_is_refused(folder: Path, name: str) -> None:
    name = name.format(root=folder.parent)
    with pytest.raises(AssetError, match="refused"):
        Assets(folder=folder).read(name)
    for file in (obj(folder, name), gltf(folder, uri=name)):
        with pytest.raises(SceneError) as caught:
            read_meshes(file)
        assert str(caught.value).startswith(f"{file}: refused to read ")
        assert "; allow the folder with --folder " in str(caught.value)
        assert str(caught.value).endswith("(scene.folders in a job), or copy the file next to the scene file")
    with pytest.raises(SceneError, match="refused"):
        read_meshes(gltf(folder, buffer=name))
    with pytest.raises(SceneError, match="refused"):
        read_stage(gltf(folder, buffer=name))


@pytest.mark.parametrize("name", FOREIGN)
def test_files_of_another_machine_are_missing(folder: Path, name: str) -> None:
    for file in (obj(folder, name), gltf(folder, uri=name)):
        found = read_meshes(file)
        assert f"texture left out, {name}: no such file next to the scene" in "; ".join(found.notes)
        assert len(found.parts) == 1
    with pytest.raises(SceneError, match="no such file"):
        read_meshes(gltf(folder, buffer=name))


@pytest.mark.parametrize("name", ["../secret.mtl", "/etc/passwd", "tex/../../secret.mtl"])
def test_material_libraries_elsewhere_are_refused(folder: Path, name: str) -> None:
    (folder.parent / "secret.mtl").write_text("newmtl Paint\n")
    file = write_obj(folder, f"mtllib {name}\n{OBJ}")
    with pytest.raises(SceneError, match="refused to read"):
        read_meshes(file)


def test_the_texture_of_a_ply_elsewhere_is_refused(folder: Path) -> None:
    file = folder / "a.ply"
    head = "ply\nformat ascii 1.0\ncomment TextureFile ../secret.png\nelement vertex 3\n"
    places = "property float x\nproperty float y\nproperty float z\n"
    faces = "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    file.write_text(f"{head}{places}{faces}0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")
    with pytest.raises(SceneError, match=r"refused to read \.\./secret\.png"):
        read_meshes(file)
    file.write_text(file.read_text().replace("../secret.png", "gone.png"))
    assert "texture left out, gone.png: no such file next to the scene" in read_meshes(file).notes


def test_every_refused_file_is_reported_once(folder: Path) -> None:
    (folder.parent / "other.png").write_bytes(IMAGE)
    file = obj(folder, "../secret.png")
    (folder / "a.mtl").write_text("newmtl Paint\nmap_Kd ../secret.png\nmap_d ../other.png\n")
    with pytest.raises(SceneError, match=r"t\.png, \.\./other\.png: they lie .* copy the files "):
        read_meshes(file)


def test_a_comment_behind_a_library_does_not_make_it_refused(folder: Path) -> None:
    obj(folder, "tex/a b.png")
    file = write_obj(folder, f"mtllib C:\\models\\a.mtl # as exported\n{OBJ}")
    assert len(read_meshes(file).textures) == 1


def test_folders_that_a_job_adds_are_read(folder: Path) -> None:
    library = folder.parent
    for name in ("../secret.png", "link.png", "library/secret.png", str(library / "secret.png"), "C:\\x\\secret.png"):
        assert Assets(folder=folder, folders=(library,)).read(name) == IMAGE
        assert len(read_meshes(obj(folder, name), [library]).textures) == 1
    with pytest.raises(SceneError, match="refused"):
        read_meshes(obj(folder, "/etc/passwd"), [library])


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_pipes_and_devices_are_not_waited_for(folder: Path) -> None:
    os.mkfifo(folder / "pipe.png")
    (folder / "device.png").symlink_to("/dev/zero")
    assert "texture left out, pipe.png: no such file next to the scene" in read_meshes(obj(folder, "pipe.png")).notes
    with pytest.raises(SceneError, match="refused"):
        read_meshes(obj(folder, "device.png"))
    os.mkfifo(folder / "pipe.glb")
    for file in (folder / "pipe.glb", Path("/dev/zero")):
        with pytest.raises(SceneError, match="got a pipe or a device"):
            read_meshes(file)


@pytest.mark.parametrize("name", ["a\0b.png", "x" * 5000, "\udcff.png", "a/" * 3000, "nul\n.png", "..", ".", "/", ""])
def test_names_that_are_no_names(folder: Path, name: str) -> None:
    with pytest.raises(AssetError) as caught:
        Assets(folder=folder).read(name)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 400


# --- images -------------------------------------------------------------------------------------------------------


def huge_png(width: int, height: int, rows: int | None = None) -> bytes:
    """A PNG of one colour, one bit per pixel; cut short after some rows."""
    rows_data = bytes((width + 7) // 8 + 1) * (height if rows is None else rows)
    return made_png(width, height, rows_data, depth=1, colour=0)


def test_an_image_bomb_is_refused(folder: Path) -> None:
    (folder / "bomb.png").write_bytes(huge_png(60_000, 60_000, rows=100))
    with pytest.raises(SceneError, match=r"a\.obj: material Paint: Image size \(3600000000 pixels\)"):
        read_meshes(obj(folder, "bomb.png"))


def test_images_count_before_they_are_decoded(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (folder / "large.png").write_bytes(huge_png(9_000, 9_000))
    monkeypatch.setattr("framearray_cli.scene.files.textures.rgba", None)
    with pytest.raises(SceneError, match=r"an image of 9000 x 9000 pixels 1\.8 GiB\), 1\.0 GiB may be used; make"):
        read_meshes(obj(folder, "large.png"), memory=2**30)


def many_materials(folder: Path, images: list[bytes]) -> Path:
    """An OBJ of a triangle for each image."""
    lines = ["v 0 0 0", "v 1 0 0", "v 0 1 0", "vt 0 0"]
    for k, image in enumerate(images):
        (folder / f"{k}.png").write_bytes(image)
        lines += [f"usemtl {k}", "f 1/1 2/1 3/1"]
    mtl = "".join(f"newmtl {k}\nmap_Kd {k}.png\n" for k in range(len(images)))
    return write_obj(folder, "\n".join(lines), mtl)


def test_textures_count_together(folder: Path) -> None:
    texels = np.zeros((8, 512, 512, 3), np.uint8)
    texels[:, 0, 0] = np.arange(8)[:, None]
    file = many_materials(folder, [png(one) for one in texels])
    assert len(read_meshes(file, memory=64 * 2**20).textures) == 8
    with pytest.raises(SceneError, match=r"\(files [\d.]+ MiB, .*textures 6\.0 MiB"):
        read_meshes(file, memory=12 * 2**20)


def test_one_image_under_many_names_is_decoded_once(folder: Path) -> None:
    meshes = read_meshes(many_materials(folder, [IMAGE] * 5))
    assert len(meshes.textures) == 1
    assert {material.texture for material in meshes.materials} == {0}


@pytest.mark.parametrize("kind", ["PNG", "JPEG", "WEBP", "TGA", "BMP", "TIFF", "GIF", "PPM"])
def test_images_that_scenes_come_with(folder: Path, kind: str) -> None:
    (folder / "image.png").write_bytes(picture(kind, "RGB"))  # of any name
    assert len(read_meshes(obj(folder, "image.png")).textures) == 1


def test_images_that_other_programs_would_draw_are_not_read(folder: Path) -> None:
    (folder / "image.png").write_bytes(picture("EPS", "RGB"))
    assert (
        "texture left out, material Paint: not an image that can be read; PNG, JPEG and EXR are"
        in read_meshes(obj(folder, "image.png")).notes
    )


def test_a_jpeg_of_very_many_scans_is_left_out(folder: Path) -> None:
    whole = picture("JPEG", "RGB")
    (folder / "image.jpg").write_bytes(whole[:-2] + b"\xff\xda\x00\x08\x01\x01\x00\x00\x3f\x00" * 200 + whole[-2:])
    assert "at most 100 scans, got 201" in "\n".join(read_meshes(obj(folder, "image.jpg")).notes)


def test_lent_memory_is_returned() -> None:
    limit = Limit(most=100)
    with limit.lend("an image", 90):
        pass
    limit.take("textures", 100)
    with pytest.raises(SceneError, match="0 MiB of memory or more"):
        limit.take("textures", 1)
