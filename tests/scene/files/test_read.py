"""Scene files of each format become parts, materials, textures and notes."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from support.scenes import QUAD, QUAD_UVS, Glb, area_vectors, png, quad_of, shared_scene, write_obj
from support.staged import LENS, animate

from framearray_cli.base.errors import SceneError
from framearray_cli.scene.files import Meshes, read_meshes
from framearray_cli.scene.files.geometry import triangulate
from framearray_cli.scene.files.model import CLAMP, MIRROR, NEAREST, SCREENED, WRAP_V, Notes
from framearray_cli.scene.files.textures import rgba
from framearray_cli.scene.scene import load_scene

RED, GREEN, BLUE, WHITE = [255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 255]
IMAGE = [[RED, GREEN], [BLUE, WHITE]]  # row 0 is the top


def shown(meshes: Meshes, point: list[float]) -> list[int]:
    """The nearest texel at a point of the only textured quad, as the renderer would look it up."""
    part = meshes.parts[0]
    texels = meshes.textures[meshes.materials[part.material].texture]
    corners, uvs = part.corners.reshape(-1, 3), part.uvs.reshape(-1, 2)
    affine, *_ = np.linalg.lstsq(np.column_stack([corners[:, :2], np.ones(len(corners))]), uvs, rcond=None)
    u, v = np.array([point[0], point[1], 1.0]) @ affine
    height, width = texels.shape[:2]
    return texels[int((1 - v) % 1 * height), int(u % 1 * width), :3].tolist()


def textured_quad(tmp_path: Path, info: dict | None = None, **sampler: int) -> Meshes:
    glb = Glb()
    texture = glb.texture(png(IMAGE), **sampler)
    material = glb.material("Paint", {"baseColorTexture": {"index": texture} | (info or {})})
    glb.node(glb.mesh(material, TEXCOORD_0=glb.accessor(QUAD_UVS)))
    return read_meshes(glb.save(tmp_path / "quad.glb"))


def notes_of(meshes: Meshes) -> str:
    return "\n".join(meshes.notes)


# --- glTF ---------------------------------------------------------------------------------------------------------


def test_glb_texture_stands_upright(tmp_path):
    meshes = textured_quad(tmp_path)
    assert shown(meshes, [0.2, 0.9]) == RED
    assert shown(meshes, [1.8, 0.9]) == GREEN
    assert shown(meshes, [0.2, 0.1]) == BLUE
    assert shown(meshes, [1.8, 0.1]) == WHITE
    assert meshes.notes == ()


@pytest.mark.parametrize("suffix", ["glb", "obj"])
def test_texture_exported_by_trimesh_stands_upright(tmp_path, suffix):
    import trimesh
    from PIL import Image

    image = Image.fromarray(np.array(IMAGE, dtype=np.uint8))
    uv = QUAD_UVS * [1, -1] + [0, 1]  # trimesh's v goes up
    visual = trimesh.visual.TextureVisuals(uv=uv, image=image)
    mesh = trimesh.Trimesh(QUAD, [[0, 1, 2], [0, 2, 3]], visual=visual, process=False)
    mesh.export(tmp_path / f"quad.{suffix}")
    meshes = read_meshes(tmp_path / f"quad.{suffix}")
    assert [shown(meshes, p) for p in ([0.2, 0.9], [1.8, 0.9], [0.2, 0.1])] == [RED, GREEN, BLUE]


def test_texture_transform_moves_the_image(tmp_path):
    info = {"extensions": {"KHR_texture_transform": {"offset": [0.5, 0.0]}}}
    meshes = textured_quad(tmp_path, info)
    assert shown(meshes, [0.2, 0.9]) == GREEN
    assert shown(meshes, [0.2, 0.1]) == WHITE


def test_texture_rotation_points_the_right_way():
    # the conformance model's arrow, turned by 22.5 degrees, must point at the mark "correct" below it
    meshes = read_meshes(shared_scene("nasty/assimp/glTF2/textureTransform/TextureTransformTest.gltf"))
    part = next(p for p in meshes.parts if meshes.materials[p.material].name == "Rotation")
    corners, uvs = part.corners.reshape(-1, 3), part.uvs.reshape(-1, 2)
    affine, *_ = np.linalg.lstsq(np.column_stack([corners[:, :2], np.ones(len(corners))]), uvs, rcond=None)
    low, high = corners.min(axis=0), corners.max(axis=0)
    x, y = np.meshgrid(np.linspace(low[0], high[0], 64), np.linspace(high[1], low[1], 64))
    uv = np.stack([x, y, np.ones_like(x)], axis=-1) @ affine
    texels = meshes.textures[meshes.materials[part.material].texture]
    n = texels.shape[0]
    seen = texels[((1 - uv[..., 1]) % 1 * n).astype(int) % n, (uv[..., 0] % 1 * n).astype(int) % n, 0]
    dark_rows, dark_columns = np.nonzero(seen < 64)
    near = dark_columns < 45  # one arrow; its repeats stand beside it
    tip = dark_columns[near][np.argmax(dark_rows[near])] / 64
    assert 0.3 < tip < 0.5  # unturned it would be at 0.7, turned the other way at 0.9


def test_second_set_of_texture_coordinates_is_used(tmp_path):
    glb = Glb()
    texture = glb.texture(png(IMAGE))
    material = glb.material("Paint", {"baseColorTexture": {"index": texture, "texCoord": 1}})
    zeros = np.zeros((4, 2), dtype=np.float32)
    mesh = glb.mesh(material, TEXCOORD_0=glb.accessor(zeros), TEXCOORD_1=glb.accessor(QUAD_UVS))
    glb.node(mesh)
    meshes = read_meshes(glb.save(tmp_path / "quad.glb"))
    assert shown(meshes, [1.8, 0.9]) == GREEN


def test_normalised_integer_coordinates(tmp_path):
    glb = Glb()
    material = glb.material("Paint", {"baseColorTexture": {"index": glb.texture(png(IMAGE))}})
    uvs = glb.accessor((QUAD_UVS * 65535).astype(np.uint16), normalized=True)
    glb.node(glb.mesh(material, TEXCOORD_0=uvs))
    meshes = read_meshes(glb.save(tmp_path / "quad.glb"))
    np.testing.assert_allclose(meshes.parts[0].uvs[0], [[0, 0], [1, 0], [1, 1]])


def test_a_texture_has_the_sampler_of_the_file(tmp_path):
    meshes = textured_quad(tmp_path, wrapS=33071, wrapT=33648, magFilter=9728)
    assert meshes.notes == ()
    assert meshes.samplers[meshes.materials[0].texture] == CLAMP | MIRROR << WRAP_V | NEAREST
    assert textured_quad(tmp_path, wrapS=10497, magFilter=9729).samplers == (0,)


def test_far_texture_coordinates_stay_where_a_texture_does_not_repeat(tmp_path):
    far = {"extensions": {"KHR_texture_transform": {"offset": [100.0, 0.0]}}}
    textured_quad(tmp_path, far, wrapS=33071)
    assert load_scene(tmp_path / "quad.glb").uvs[..., 0].min() == 100
    textured_quad(tmp_path, far)
    assert load_scene(tmp_path / "quad.glb").uvs[..., 0].max() <= 1


def test_factors_arrive_unrounded(tmp_path):
    wall = quad_of("Wall", {"baseColorFactor": [0.1234, 0.5, 0.9, 1.0]})
    material = read_meshes(wall.save(tmp_path / "a.glb")).materials[0]
    assert material.reflectivity == (0.1234, 0.5, 0.9)


@pytest.mark.parametrize(
    ("metallic", "roughness", "reflectivity", "specular"),
    [(1.0, 0.1, 0.0, 0.8), (0.25, 0.0, 0.6, 0.2), (1.0, 0.11, 0.8, 0.0), (0.0, 0.0, 0.8, 0.0)],
)
def test_smooth_metal_is_a_mirror(tmp_path, metallic, roughness, reflectivity, specular):
    pbr = {"baseColorFactor": [0.8, 0.8, 0.8, 1], "metallicFactor": metallic, "roughnessFactor": roughness}
    meshes = read_meshes(quad_of("M", pbr).save(tmp_path / "a.glb"))
    assert meshes.materials[0].reflectivity == pytest.approx((reflectivity,) * 3)
    assert meshes.materials[0].specular == pytest.approx((specular,) * 3)
    assert ("rough metals" in notes_of(meshes)) == (roughness == 0.11)


def test_metallic_roughness_texture_counts_by_its_mean(tmp_path):
    image = png([[[0, 0, 255], [0, 51, 255]]])  # roughness 0 and 0.2, metal
    pbr = {"metallicFactor": 1.0, "roughnessFactor": 0.9, "metallicRoughnessTexture": image}
    meshes = read_meshes(quad_of("M", pbr).save(tmp_path / "a.glb"))
    assert meshes.materials[0].specular == pytest.approx((1.0, 1.0, 1.0))
    assert "by their mean" in notes_of(meshes)
    assert meshes.textures == ()


def leaf(tmp_path, factor: float, alpha: int, more: dict, **options: bool) -> Meshes:
    """A quad whose texture has that alpha on one half."""
    pbr = {"baseColorFactor": [1, 1, 1, factor], "baseColorTexture": png([[[*RED, 255], [*RED, alpha]]])}
    return read_meshes(quad_of("Leaf", pbr, **more).save(tmp_path / "a.glb"), **options)


@pytest.mark.parametrize(
    ("more", "factor", "alpha", "cutoff", "left_out", "note"),
    [
        ({"alphaMode": "OPAQUE"}, 0.1, 0, 0.0, "", ""),
        ({"alphaMode": "MASK"}, 1.0, 0, 0.5, "", ""),
        ({"alphaMode": "MASK", "alphaCutoff": 0.2}, 1.0, 128, 0.0, "", ""),
        ({"alphaMode": "MASK", "alphaCutoff": 0.2}, 0.1, 255, 0.0, "cut out", "removes everywhere"),
        ({"alphaMode": "BLEND"}, 1.0, 0, 0.5, "", "cut out at half"),
        ({"alphaMode": "BLEND"}, 0.5, 255, 0.0, "", "taken as opaque"),
        ({"alphaMode": "BLEND"}, 0.2, 255, 0.0, "transmissive", "as thin glass: Leaf"),
        ({"extensions": {"KHR_materials_transmission": {"transmissionFactor": 1}}}, 1.0, 255, 0.0, "transmissive", ""),
    ],
)
def test_opacity(tmp_path, more, factor, alpha, cutoff, left_out, note):
    meshes = leaf(tmp_path, factor, alpha, more)
    material = meshes.materials[0]
    assert (material.alpha_cutoff, material.left_out) == (cutoff, left_out)
    assert (material.alpha_texture >= 0) == (cutoff > 0)
    assert note in notes_of(meshes)


@pytest.mark.parametrize(
    ("more", "factor", "lowest", "alpha"),
    [
        ({"alphaMode": "BLEND"}, 1.0, 0, 1.0),
        ({"alphaMode": "BLEND"}, 0.5, 255, 0.5),
        ({"alphaMode": "BLEND"}, 1.0, 255, None),
        ({"extensions": {"KHR_materials_transmission": {"transmissionFactor": 0.6}}}, 1.0, 255, 0.4),
    ],
)
def test_blends_are_screens_where_surfaces_follow_the_file(tmp_path, more, factor, lowest, alpha):
    meshes = leaf(tmp_path, factor, lowest, more, as_file=True)
    material = meshes.materials[0]
    assert (material.left_out, material.glass) == ("", None)
    assert material.alpha_cutoff == (0.0 if alpha is None else SCREENED)
    assert material.alpha == pytest.approx(alpha or 1.0)
    assert ("by chance" in notes_of(meshes)) == (alpha is not None)


def test_vertex_colours_beside_a_material_stay_linear(tmp_path):
    colours = np.array([[0.25, 0.5, 1.0]] * 4, dtype=np.float32)
    part = read_meshes(quad_of("M", COLOR_0=colours).save(tmp_path / "a.glb")).parts[0]
    assert np.array_equal(part.colours, np.broadcast_to(colours[0], (2, 3, 3)))


def test_vertex_colours_without_material_multiply_white(tmp_path):
    glb = Glb()
    colours = np.full((4, 4), 65535, dtype=np.uint16)
    glb.node(glb.mesh(COLOR_0=glb.accessor(colours, normalized=True)))
    meshes = read_meshes(glb.save(tmp_path / "a.glb"))
    assert meshes.materials[meshes.parts[0].material].reflectivity == (1.0, 1.0, 1.0)
    assert (meshes.parts[0].colours == 1).all()


def test_no_material_is_grey_and_said_so(tmp_path):
    meshes = read_meshes(quad_of().save(tmp_path / "a.glb"))
    assert meshes.materials[0].reflectivity == (0.5, 0.5, 0.5)
    assert "without material" in notes_of(meshes)


@pytest.mark.parametrize("kind", ["lines", "camera"])
def test_points_and_lines_are_noted_and_children_stay(tmp_path, kind):
    """Below a camera, too."""
    glb = Glb()
    child = glb.add("nodes", {"mesh": glb.mesh(), "translation": [0, 0, 1]})
    parent = {"camera": glb.add("cameras", LENS)} if kind == "camera" else {"mesh": glb.mesh(mode=1)}
    glb.node(**parent, translation=[5, 0, 0], children=[child])
    meshes = read_meshes(glb.save(tmp_path / "a.glb"))
    assert ("points and lines" in notes_of(meshes)) == (kind == "lines")
    assert np.array_equal(meshes.parts[0].corners.min(axis=(0, 1)), [5, 0, 1])


def test_sparse_accessor_moves_a_vertex(tmp_path):
    glb = Glb()
    mesh = glb.mesh()
    position = glb.tree["meshes"][mesh]["primitives"][0]["attributes"]["POSITION"]
    glb.tree["accessors"][position]["sparse"] = glb.sparse(np.uint16([3]), np.float32([0, 7, 0]))
    glb.node(mesh)
    corners = read_meshes(glb.save(tmp_path / "a.glb")).parts[0].corners
    assert corners[1, 2].tolist() == [0, 7, 0]


def test_gpu_instances_stand_at_their_places(tmp_path):
    """Scaled, turned, then moved; a mirrored one keeps its outside, and a rotation may be a normalised integer."""
    glb = Glb()
    moves = glb.accessor(np.array([[0, 0, 0], [0, 0, 5], [7, 0, 0]], dtype=np.float32))
    scales = glb.accessor(np.array([[1, 1, 1], [2, 2, 2], [-1, 1, 1]], dtype=np.float32))
    turns = glb.accessor(np.array([[0, 0, 0, 127], [0, 0, 127, 0], [0, 0, 0, 0]], dtype=np.int8), normalized=True)
    rows = {"TRANSLATION": moves, "SCALE": scales, "ROTATION": turns, "_ID": moves}
    mesh = glb.mesh(glb.material("Paint"))
    glb.node(mesh, translation=[0, 1, 0], extensions={"EXT_mesh_gpu_instancing": {"attributes": rows}})
    glb.node(mesh, translation=[0, 1, 0], extensions={"EXT_mesh_gpu_instancing": {"attributes": {"_ID": moves}}})
    glb.tree["extensionsUsed"] = ["EXT_mesh_gpu_instancing"]
    found = read_meshes(glb.save(tmp_path / "a.glb"))
    many, one = (part.corners - [0, 1, 0] for part in found.parts)
    assert many.shape == (3 * len(one), 3, 3) and not found.notes
    first, second, third = np.split(many, 3)
    np.testing.assert_array_equal(first, one)
    np.testing.assert_allclose(second, one * [-2, -2, 2] + [0, 0, 5], atol=1e-12)
    np.testing.assert_array_equal(third, one[:, ::-1] * [-1, 1, 1] + [7, 0, 0])


def test_mirrored_node_keeps_its_outside(tmp_path):
    glb = Glb()
    normals = glb.accessor(np.array([[0.6, 0, 0.8]] * 4, dtype=np.float32))
    glb.node(glb.mesh(NORMAL=normals), scale=[-2, 1, 1])
    part = read_meshes(glb.save(tmp_path / "a.glb")).parts[0]
    assert area_vectors(part.corners)[0, 2] > 0
    np.testing.assert_allclose(
        part.normals[0, 0] / np.linalg.norm(part.normals[0, 0]), [-0.35112, 0, 0.93633], atol=1e-5
    )


@pytest.mark.parametrize(
    ("edit", "expected"),
    [
        (lambda tree: tree["nodes"].append({"children": [1]}), "cycle"),
        (lambda tree: tree.pop("scenes"), "expected a scene"),
        (lambda tree: tree.update(extensionsUsed=["EXT_meshopt_compression"]), "meshopt"),
        (lambda tree: tree["asset"].update(version="1.0"), "glTF 2"),
    ],
)
def test_broken_gltf_is_one_clear_error(tmp_path, edit, expected):
    glb = quad_of()
    edit(glb.tree)
    with pytest.raises(SceneError, match=expected):
        read_meshes(glb.save(tmp_path / "a.glb"))


def test_truncated_glb(tmp_path):
    file = quad_of().save(tmp_path / "a.glb")
    file.write_bytes(file.read_bytes()[:-20])
    with pytest.raises(SceneError, match="cut short"):
        read_meshes(file)


def test_ignored_features_are_noted(tmp_path):
    glb = Glb()
    extension = {"KHR_materials_iridescence": {"iridescenceFactor": 1}}
    material = glb.material("Car", emissiveFactor=[1, 0, 0], normalTexture={"index": 0}, extensions=extension)
    glb.texture(png(IMAGE))
    glb.tree["extensionsUsed"] = ["KHR_lights_punctual", "KHR_xmp", "KHR_materials_iridescence"]
    node = glb.node(glb.mesh(material))
    animate(glb, node, "translation", [0, 1], [[0, 0, 0], [1, 0, 0]])
    text = notes_of(read_meshes(glb.save(tmp_path / "a.glb")))
    for expected in ("KHR_xmp", "iridescence", "scene.time", "emission", "normal maps"):
        assert expected in text


def test_what_stands_in_for_an_extension_is_noted(tmp_path):
    glb = Glb()
    found = {"KHR_materials_anisotropy": {}, "KHR_materials_sheen": {}, "KHR_materials_dispersion": {}, "EXT_odd": {}}
    for name in ("Car", "Boat"):
        glb.node(glb.mesh(glb.material(name, extensions=found)))
    assert read_meshes(glb.save(tmp_path / "a.glb")).notes == (
        "EXT_odd is left out: Car, Boat",
        "KHR_materials_anisotropy is left out; brushed surfaces look the same from all sides: Car, Boat",
        "KHR_materials_dispersion is left out; glass does not part colours: Car, Boat",
    )


@pytest.mark.parametrize(("uri", "expected"), [("gone.png", "no such file"), ("broken.png", "not an image")])
def test_missing_texture_is_noted(tmp_path, uri, expected):
    (tmp_path / "broken.png").write_bytes(png(IMAGE)[:40])
    glb = Glb()
    glb.add("textures", {"source": glb.add("images", {"uri": uri})})
    material = glb.material("Paint", {"baseColorTexture": {"index": 0}, "baseColorFactor": [0.3, 0.3, 0.3, 1]})
    glb.node(glb.mesh(material, TEXCOORD_0=glb.accessor(QUAD_UVS)))
    meshes = read_meshes(glb.save(tmp_path / "a.glb"))
    assert meshes.materials[0].texture == -1
    assert expected in notes_of(meshes)


def test_gltf_with_files_beside_it(tmp_path):
    glb = quad_of()
    (tmp_path / "the data.bin").write_bytes(glb.blob)
    glb.tree["buffers"] = [{"byteLength": len(glb.blob), "uri": "the%20data.bin"}]
    (tmp_path / "a.gltf").write_text(json.dumps(glb.tree))
    assert len(read_meshes(tmp_path / "a.gltf").parts[0].corners) == 2


# --- OBJ ----------------------------------------------------------------------------------------------------------

OBJ_QUAD = "v 0 0 0\nv 2 0 0\nv 2 1 0\nv 0 1 0\n"


def read_obj_text(tmp_path: Path, text: str, mtl: str | None = None) -> Meshes:
    return read_meshes(write_obj(tmp_path, text, mtl))


@pytest.mark.parametrize(
    "text",
    [
        OBJ_QUAD + "f 1 2 3 4\n",
        OBJ_QUAD + "f -4 -3 -2 -1\n",
        OBJ_QUAD + "f -4 -3 -2 -1\nv 9 9 9\nv 9 9 9\nv 9 9 9\nv 9 9 9\n",
        "v\t0  0\t0 # here\r\nv 2 0 0\r\nv 2 1 0\r\nv 0 1 0\r\nf 1 2 \\\r\n3 4 # there\r\n",
        "g f three\no f 1 2 3\n" + OBJ_QUAD + "  f 1// 2// 3// 4//",
        OBJ_QUAD + "f 1 2 3\nf 1/7/9 3 4\n",
    ],
)
def test_obj_spellings_of_one_quad(tmp_path, text):
    corners = read_obj_text(tmp_path, text).parts[0].corners
    assert np.array_equal(corners, QUAD[[[0, 1, 2], [0, 2, 3]]])


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-be", "utf-8-sig", "latin-1"])
def test_obj_encodings(tmp_path, encoding):
    (tmp_path / "a.obj").write_bytes((OBJ_QUAD + "# \xe9\nf 1 2 3 4\n").encode(encoding))
    assert len(read_meshes(tmp_path / "a.obj").parts[0].corners) == 2


def test_obj_keeps_64_bits(tmp_path):
    text = "v 5000000.125 0 0\nv 5000000.25 0 0\nv 5000000.25 0.5 0\nf 1 2 3\n"
    assert read_obj_text(tmp_path, text).parts[0].corners[0, 0, 0] == 5000000.125


def test_obj_normals_texture_coordinates_and_colours(tmp_path):
    text = "v 0 0 0 1 0 0\nv 1 0 0\nv 0 1 0 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\nvn 0 0 2\nusemtl M\nf 1/1/1 2/2/-1 3/3\n"
    (tmp_path / "t.png").write_bytes(png(IMAGE))
    meshes = read_obj_text(tmp_path, text, "newmtl M\nmap_Kd -o 0.5 0.25 -type sphere -clamp on t.png\n")
    part = meshes.parts[0]
    assert part.colours[0].tolist() == [[1, 0, 0], [1, 1, 1], [0, 0, 1]]
    assert part.uvs[0].tolist() == [[0, 0], [1, 0], [0, 1]]
    assert "options of maps (-clamp, -o, -type) are left out: M" in meshes.notes
    assert part.normals[0, :2].tolist() == [[0, 0, 2], [0, 0, 2]]
    assert np.isnan(part.normals[0, 2]).all()
    assert meshes.materials[0].reflectivity == (1.0, 1.0, 1.0)


def test_obj_index_out_of_range_is_counted(tmp_path):
    meshes = read_obj_text(tmp_path, OBJ_QUAD + "f 1 2 3\nf 1 2 9\nf 0 1 2\nf -9 1 2\n")
    assert meshes.dropped == {"index out of range": 3}
    assert len(meshes.parts[0].corners) == 1


@pytest.mark.parametrize("line", ["f 1 x 3", "v 1 2", "v a b c", "f 1/2/3/4 2 3"])
def test_obj_nonsense_is_one_clear_error(tmp_path, line):
    with pytest.raises(SceneError, match=f"'{line[0]}' line"):
        read_obj_text(tmp_path, OBJ_QUAD + "f 1 2 3\n" + line + "\n")


@pytest.mark.parametrize(
    ("lines", "reflectivity", "specular", "left_out"),
    [
        ("Kd 0.2 0.3 0.4 # note", (0.2, 0.3, 0.4), (0, 0, 0), ""),
        ("Kd 0 0 0\nKs 0.9 0.8 0.7\nillum 3\nNs 1000", (0, 0, 0), (0.9, 0.8, 0.7), ""),
        ("Kd 0 0 0\nKs 0.9 0.8 0.7\nillum 5", (0, 0, 0), (0.9, 0.8, 0.7), ""),
        ("Kd 0 0 0\nKs 0.9 0.8 0.7\nillum 3\nNs 200", (0.9, 0.8, 0.7), (0, 0, 0), ""),
        ("Kd 0.4 0.4 0.4\nKs 0.9 0.8 0.7\nillum 2", (0.4, 0.4, 0.4), (0, 0, 0), ""),
        ("Kd 1 1 1\nd 0.1", (1, 1, 1), (0, 0, 0), "transmissive"),
        ("Kd 1 1 1\nTr 0.9", (1, 1, 1), (0, 0, 0), "transmissive"),
        ("Kd 1 1 1\nTr 1", (1, 1, 1), (0, 0, 0), ""),
        ("Kd 1 1 1\nd 0", (1, 1, 1), (0, 0, 0), "transmissive"),
        ("Kd 1 1 1\nd 0\nmap_Kd t.png", (1, 1, 1), (0, 0, 0), ""),
        ("Kd 1 1 1\nKs 1 1 1\nillum 3\nNs 1000", (0.5, 0.5, 0.5), (0.5, 0.5, 0.5), ""),
        ("Kd 3 nan 1", (1, 0, 1), (0, 0, 0), ""),
        ("Kd inf inf 0\nillum 3", (1, 1, 0), (0, 0, 0), ""),
        ("Kd nan 1 1e999\nillum 3", (0, 1, 1), (0, 0, 0), ""),
        ("Kd inf inf inf\nKs inf 0 0\nillum 3", (0.5, 1, 1), (0.5, 0, 0), ""),
        ("Ns 5", (0.5, 0.5, 0.5), (0, 0, 0), ""),
    ],
)
def test_mtl(tmp_path, lines, reflectivity, specular, left_out):
    text = OBJ_QUAD + "usemtl A b\nf 1 2 3\nusemtl Other\nf 1 3 4\n"
    meshes = read_obj_text(tmp_path, text, f"newmtl A b\n{lines}\nnewmtl Other\n")
    material = meshes.materials[0]
    assert material.name == "A b"
    assert material.reflectivity == pytest.approx(reflectivity)
    assert material.specular == pytest.approx(specular)
    assert material.left_out == left_out


@pytest.mark.parametrize("as_file", [False, True])
@pytest.mark.parametrize("lines", ["d 0", "d 0\nNi 1.5\nillum 4", "Tr 0.9"])
def test_materials_that_would_leave_nothing_visible_are_opaque_with_a_note(tmp_path, lines, as_file):
    text = OBJ_QUAD + "usemtl A\nf 1 2 3\nusemtl B\nf 1 3 4\n"
    file = write_obj(tmp_path, text, f"newmtl A\nKd 0.2 0.3 0.4\n{lines}\nnewmtl B\n{lines}\n")
    scene = load_scene(file, as_file=as_file)
    assert len(scene.corners) == 2 and not scene.has_glass
    np.testing.assert_allclose(scene.reflectivity[0], [0.2, 0.3, 0.4], rtol=1e-6)
    assert [note for note in scene.report.notes if "glass that is not" not in note] == [
        "materials that would leave nothing visible are taken as opaque: A, B"
    ]


@pytest.mark.parametrize("as_file", [False, True])
@pytest.mark.parametrize(
    ("alpha", "more"),
    [
        (0.0, {"alphaMode": "BLEND"}),
        (0.0, {"alphaMode": "MASK"}),
        (1.0, {"extensions": {"KHR_materials_transmission": {"transmissionFactor": 1.0}}}),
    ],
)
def test_a_glb_that_would_be_invisible_is_opaque_with_a_note(tmp_path, alpha, more, as_file):
    glb = quad_of("A", {"baseColorFactor": [1, 1, 1, alpha]}, **more)
    scene = load_scene(glb.save(tmp_path / "a.glb"), as_file=as_file)
    assert (len(scene.corners), scene.report.dropped) == (2, {})
    assert scene.report.notes == ("materials that would leave nothing visible are taken as opaque: A",)


def test_mtl_factor_multiplies_the_texture_and_map_d_cuts_out(tmp_path):
    (tmp_path / "t one.png").write_bytes(png(IMAGE))
    (tmp_path / "mask.png").write_bytes(png([[[0, 0, 0], [255, 255, 255]]]))
    mtl = "newmtl M\nKd 0.5 0.5 0.5\nmap_Kd .\\t one.png\nmap_d C:\\elsewhere\\mask.png\n"
    meshes = read_obj_text(tmp_path, OBJ_QUAD + "vt 0 0\nusemtl M\nf 1/1 2/1 3/1\n", mtl)
    material = meshes.materials[0]
    assert material.reflectivity == (0.5, 0.5, 0.5)
    assert meshes.textures[material.texture][0, 0].tolist() == [255, 0, 0, 255]
    assert meshes.textures[material.alpha_texture][0, :, 3].tolist() == [0, 255]
    assert material.alpha_cutoff == 0.5


def test_mtl_maps_in_tiles(tmp_path):
    """Each has its own number of tiles, and its own texture coordinates."""
    for name, grey in (("t.1001", 50), ("t.1002", 100), ("n.1001", 128), ("n.1011", 64), ("mask", 255)):
        (tmp_path / f"{name}.png").write_bytes(png([[[grey] * 3]]))
    text = OBJ_QUAD + "vt 0 0\nvt 1.5 0\nvt 0 1\nusemtl M\nf 1/1 2/2 3/3\n"
    file = write_obj(tmp_path, text, "newmtl M\nmap_Kd t.<UDIM>.png\nmap_d mask.png\nbump n.<UDIM>.png\n")
    meshes = read_meshes(file, as_file=True)
    (part,), (material,) = meshes.parts, meshes.materials
    assert meshes.textures[material.texture][..., 0].tolist() == [[50, 100]]
    assert part.uvs[0].tolist() == [[0, 0, 0, 0], [0.75, 0, 1.5, 0], [0, 1, 0, 1]]
    assert part.normal_uvs[0].tolist() == [[0, 0], [1.5, 0], [0, 0.5]]
    assert meshes.textures[material.normal_texture].shape == (2, 1, 4)
    text = notes_of(read_obj_text(tmp_path, text, "newmtl M\nmap_Kd gone.<UDIM>.png\n"))
    assert "texture left out, gone.1001.png: no such file next to the scene" in text


def test_obj_missing_library_and_material_are_noted(tmp_path):
    text = notes_of(read_obj_text(tmp_path, "mtllib gone.mtl\n" + OBJ_QUAD + "usemtl Gold\nf 1 2 3\n"))
    assert "gone.mtl" in text
    assert "Gold" in text


def area(corners: np.ndarray) -> float:
    return float(area_vectors(corners)[:, 2].sum())


def test_polygons_concave_and_convex():
    arrow = np.array([[0, 0, 0], [2, 1, 0], [0, 2, 0], [1, 1, 0]], dtype=np.float64)
    square = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]], dtype=np.float64)
    both = np.stack([*(np.roll(arrow, k, axis=0) for k in range(4)), square])
    triangles = triangulate(both, Notes())
    for polygon, own, total in zip(both, triangles, (1.0, 1.0, 1.0, 1.0, 4.0), strict=True):
        assert (area_vectors(polygon[own])[:, 2] > 0).all()  # a fan across a notch has a triangle turned over
        assert area(polygon[own]) == pytest.approx(total)


def test_concave_polygons_of_very_many_corners_become_fans():
    """Cutting ears takes time that grows with the square of the corners: 40 s for 50 outlines of 4,000."""
    for n, fans in ((100, False), (2002, True)):
        angle = np.linspace(0, 2 * np.pi, n, endpoint=False)
        star = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle]) * (1 + 0.5 * (np.arange(n) % 2))[:, None]
        notes = Notes()
        (own,) = triangulate(star[None], notes)
        assert bool((own[:, 0] == 0).all()) == bool(notes.found) == fans
        assert area(star[own]) == pytest.approx(n * 0.75 * np.sin(angle[1]))


def test_star_and_bridged_hole_have_the_right_area():
    angle = np.arange(10) * np.pi / 5
    radius = np.where(np.arange(10) % 2, 0.4, 1.0)
    star = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle])
    assert area(star[triangulate(star[None], Notes())[0]]) == pytest.approx(10 * 0.5 * 0.4 * np.sin(np.pi / 5))
    ring = [[0, 0], [4, 0], [4, 4], [0, 4], [0, 0], [1, 1], [1, 3], [3, 3], [3, 1], [1, 1]]
    flat = np.column_stack([np.array(ring, dtype=np.float64), np.zeros(10)])
    parts = flat[triangulate(flat[None], Notes())[0]]
    assert area(parts) == pytest.approx(12)
    assert np.abs(area_vectors(parts)[:, 2]).sum() == pytest.approx(12)


# --- PLY, STL and the door itself ---------------------------------------------------------------------------------

PLY_HEAD = "ply\nformat ascii 1.0\nelement vertex 3\nproperty double x\nproperty double y\nproperty double z\n"


def test_ply_keeps_64_bits_vertex_colours_and_its_own_normals(tmp_path):
    head = PLY_HEAD + "property float nx\nproperty float ny\nproperty float nz\n"
    head += "property uchar red\nproperty uchar green\nproperty uchar blue\n"
    head += "element face 1\nproperty list uchar int vertex_index\nend_header\n"
    rows = ["5000000.125 0 0 0 0 1 255 0 0", "5000001 0 0 0 0 1 0 255 0", "5000001 1 0 0 0 1 0 0 51"]
    (tmp_path / "a.ply").write_text(head + "\n".join(rows) + "\n\n3 0 1 2\n")
    part = read_meshes(tmp_path / "a.ply").parts[0]
    assert part.corners[0, 0, 0] == 5000000.125
    assert part.normals[0].tolist() == [[0, 0, 1]] * 3
    assert part.colours[0] == pytest.approx(np.array([[1, 0, 0], [0, 1, 0], [0, 0, 0.2]]))


def test_ply_face_colours(tmp_path):
    head = PLY_HEAD.replace("vertex 3", "vertex 4") + "element face 2\nproperty list uchar int vertex_index\n"
    head += "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n"
    (tmp_path / "a.ply").write_text(head + "0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2 255 0 0\n3 0 2 3 0 0 255\n")
    part = read_meshes(tmp_path / "a.ply").parts[0]
    assert part.colours.tolist() == [[[1, 0, 0]] * 3, [[0, 0, 1]] * 3]
    assert part.normals is None


def test_stl_has_no_normals_of_its_own(tmp_path):
    import trimesh

    trimesh.creation.box().export(tmp_path / "a.stl")
    meshes = read_meshes(tmp_path / "a.stl")
    assert len(meshes.parts[0].corners) == 12
    assert meshes.parts[0].normals is None
    assert "without material" in notes_of(meshes)


@pytest.mark.parametrize(
    ("name", "data", "expected"),
    [
        ("gone.glb", None, "no such scene file"),
        ("", None, "folder"),
        ("noise.glb", b"\x8a\x01\xff\x9c" * 9, "broken, or not GLB .it is no text.; export it anew"),
        ("a.blend", b"BLENDER", "Blender writes a GLB and a job of it: blender --background"),
        ("a.xcf", b"x", "known are .*, ifc, .*, usd,"),
        ("a", b"x", "known format"),
        ("a.obj", b"", "empty file"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\n", "expected triangles"),
        ("a.obj", b"# nothing\n", "expected triangles"),
        ("a.glb", b"\x00\x01\x02 no scene at all", "broken"),
        ("a.stl", b"solid nothing", "a.stl"),
        ("a.ply", b"ply\nformat ascii 1.0\n", "a.ply"),
        ("a.off", b"OFF\n353535235358 3 0\n0 0 0\n", "a.off"),
    ],
)
def test_what_cannot_be_read_is_one_clear_error(tmp_path, capfd, name, data, expected):
    if data is not None:
        (tmp_path / name).write_bytes(data)
    with pytest.raises(SceneError, match=expected) as caught:
        read_meshes(tmp_path / name)
    assert caught.value.exit_code == 3
    assert str(tmp_path / name) in str(caught.value)
    assert capfd.readouterr() == ("", "")


def test_without_pillow_no_texture_is_lost_in_silence(tmp_path, monkeypatch):
    file = quad_of("a", {"baseColorTexture": png(IMAGE)}).save(tmp_path / "a.glb")
    monkeypatch.setitem(sys.modules, "PIL", None)
    monkeypatch.delitem(sys.modules, "PIL.Image", raising=False)
    with pytest.raises(SceneError, match=r"pip install .*Pillow"):
        read_meshes(file)
    (tmp_path / "a.ply").write_text("ply\n")
    with pytest.raises(SceneError, match=r"pip install .*Pillow"):
        read_meshes(tmp_path / "a.ply")


def test_help_never_waits_for_trimesh():
    code = "import sys, framearray_cli.scene.scene; sys.exit('trimesh' in sys.modules or 'PIL' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize(
    ("mode", "pixel", "expected"),
    [
        ("L", 100, [100, 100, 100, 255]),
        ("LA", (100, 7), [100, 100, 100, 7]),
        ("RGBA", (1, 2, 3, 4), [1, 2, 3, 4]),
        ("1", 1, [255, 255, 255, 255]),
        ("CMYK", (0, 255, 255, 0), [255, 0, 0, 255]),
        ("I;16", 0x8040, [128, 128, 128, 255]),
        ("I", 0x8040, [128, 128, 128, 255]),
        ("F", 0.5, [128, 128, 128, 255]),
    ],
)
def test_image_modes(mode, pixel, expected):
    from PIL import Image

    image = Image.new(mode, (3, 2), pixel)
    texels, note = rgba(image)
    assert (texels.shape, note) == ((2, 3, 4), "")
    assert texels[0, 0].tolist() == expected


def test_palette_with_transparency():
    from PIL import Image

    image = Image.new("P", (2, 1))
    image.putpalette([10, 20, 30, 40, 50, 60])
    image.putpixel((1, 0), 1)
    image.info["transparency"] = 0
    assert rgba(image)[0][0].tolist() == [[10, 20, 30, 0], [40, 50, 60, 255]]
