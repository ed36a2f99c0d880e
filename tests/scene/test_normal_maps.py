"""Normal maps of a glTF file, as the scene has them, and tangents against a slow twin of MikkTSpace."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from support import tiny
from support.scenes import QUAD, QUAD_UVS, Glb, check_shapes, png, quad_of

from framearray_cli.base.errors import SceneError
from framearray_cli.job.job import MaterialTable
from framearray_cli.scene.files.geometry import compute_tangents
from framearray_cli.scene.scene import Scene, load_scene, scene_report_lines

UP = np.broadcast_to(np.float32([0, 0, 1]), (4, 3))
IMAGE = [[[128, 128, 255], [255, 128, 128]]]


def mapped_quad(folder: Path, info: Any = None, *, uvs: Any = QUAD_UVS, node: Any = None, **attributes: Any) -> Path:
    """A quad with a normal map and no other texture."""
    glb = Glb()
    image = {"index": glb.texture(png(IMAGE)), **(info or {})}
    found = {name: glb.accessor(np.ascontiguousarray(values)) for name, values in attributes.items()}
    if uvs is not None:
        found["TEXCOORD_0"] = glb.accessor(uvs.astype(np.float32))
    glb.node(glb.mesh(glb.material("Wall", normalTexture=image), **found), **(node or {}))
    return glb.save(folder / "quad.glb")


def read(file: Path) -> Scene:
    scene = load_scene(file, as_file=True)
    check_shapes(scene)
    return scene


def tangents_of(scene: Scene) -> Any:
    """The tangents that occur, as a list."""
    return np.unique(scene.tangents.reshape(-1, 4).round(6), axis=0).tolist()


def test_diffuse_surfaces_read_no_map(tmp_path: Path) -> None:
    scene = load_scene(mapped_quad(tmp_path))
    assert (len(scene.textures), len(scene.tangents), len(scene.normal_uvs), len(scene.normals)) == (0, 0, 0, 0)
    assert scene.normal_texture.tolist() == [-1]
    assert scene.report.notes == ('normal maps are left out; scene.surfaces = "file" uses them: Wall',)


def test_a_map_has_its_tangents_coordinates_and_scale(tmp_path: Path) -> None:
    scene = read(mapped_quad(tmp_path, {"scale": 0.5}))
    assert tangents_of(scene) == [[1, 0, 0, 1]]
    assert scene.normals.reshape(-1, 3).tolist() == [[0, 0, 1]] * 6  # the geometric ones, as the file has none
    assert scene.normal_uvs[0].tolist() == [[0, 0], [1, 0], [1, 1]]
    assert (scene.normal_texture.tolist(), scene.normal_scale.tolist()) == ([0], [0.5])
    assert len(scene.uvs) == 0
    assert scene_report_lines(scene.report, "a.glb") == [
        "a.glb: 2 triangles, 1 material, 1 texture, 1 normal map in use"
    ]


def test_tangents_of_the_file_are_kept(tmp_path: Path) -> None:
    given = np.array([[0, 2, 0, -1]] * 4, np.float32)
    assert tangents_of(read(mapped_quad(tmp_path, NORMAL=UP, TANGENT=given))) == [[0, 1, 0, -1]]


@pytest.mark.parametrize("broken", [[0, 0, 0, 1], [np.nan, 0, 0, 1]])
def test_tangents_that_are_none_are_computed(tmp_path: Path, broken: Any) -> None:
    given = np.array([[0, 1, 0, -1]] * 3 + [broken], np.float32)
    assert tangents_of(read(mapped_quad(tmp_path, NORMAL=UP, TANGENT=given))) == [[1, 0, 0, 1]]
    # without normals those of the file mean nothing [glTF]
    assert tangents_of(read(mapped_quad(tmp_path, TANGENT=given[[0, 0, 0, 0]]))) == [[1, 0, 0, 1]]


def test_a_map_has_a_set_and_a_transform_of_its_own(tmp_path: Path) -> None:
    info = {"texCoord": 1, "extensions": {"KHR_texture_transform": {"rotation": np.pi / 2, "scale": [2, 1]}}}
    scene = read(mapped_quad(tmp_path, info, TEXCOORD_1=QUAD_UVS))
    # glTF turns the picture clockwise as v points down: (u, v) shows what stands at (v, -2 u) of the image
    u, v = QUAD_UVS[[0, 1, 2]].T
    assert scene.normal_uvs[0] == pytest.approx(np.stack([v, 1 + 2 * u], axis=1), abs=1e-6)
    assert tangents_of(scene) == [[0, -1, 0, 1]]


def test_mirrored_and_scaled_nodes(tmp_path: Path) -> None:
    """In a mirror, normal x tangent points against the bitangent, so w changes its sign."""
    turned = {"scale": [-3, 1, 1]}
    assert tangents_of(read(mapped_quad(tmp_path, node=turned))) == [[-1, 0, 0, -1]]
    assert tangents_of(read(mapped_quad(tmp_path, node={"scale": [1e-6] * 3}))) == [[1, 0, 0, 1]]


def test_a_mesh_without_coordinates_shows_no_map(tmp_path: Path) -> None:
    scene = read(mapped_quad(tmp_path, uvs=None))
    assert len(scene.tangents) == 0
    assert scene.report.notes == ("meshes without texture coordinates show no normal map: Wall",)


def test_parts_without_a_map_have_no_tangents(tmp_path: Path) -> None:
    glb = Glb()
    coordinates = {"TEXCOORD_0": glb.accessor(QUAD_UVS)}
    bumpy = glb.material("Bumpy", normalTexture={"index": glb.texture(png(IMAGE))})
    glb.node(glb.mesh(bumpy, **coordinates))
    glb.node(glb.mesh(glb.material("Flat"), positions=QUAD + np.float32([0, 0, 1]), **coordinates))
    scene = read(glb.save(tmp_path / "two.glb"))
    flat = scene.material == scene.material_names.index("Flat")
    assert not scene.tangents[flat].any() and scene.tangents[~flat].any()
    assert scene.normal_texture[scene.material[flat]].tolist() == [-1, -1]


def test_a_map_that_cannot_be_read_is_left_out(tmp_path: Path) -> None:
    glb = Glb()
    gone = glb.add("textures", {"source": glb.add("images", {"uri": "gone.png"})})
    mesh = glb.mesh(glb.material("Wall", normalTexture={"index": gone}), TEXCOORD_0=glb.accessor(QUAD_UVS))
    glb.node(mesh)
    scene = read(glb.save(tmp_path / "a.glb"))
    assert len(scene.tangents) == 0
    assert "gone.png" in scene.report.notes[0]


@pytest.mark.parametrize("info", [{"index": 7}, {"index": 0, "scale": "much"}, {}])
def test_what_is_no_normal_map_is_refused_with_its_place(tmp_path: Path, info: Any) -> None:
    glb = Glb()
    glb.texture(png(IMAGE))
    glb.node(glb.mesh(glb.material("Wall", normalTexture=info)))
    with pytest.raises(SceneError, match=r"materials\[0\].normalTexture"):
        load_scene(glb.save(tmp_path / "a.glb"), as_file=True)


# --- OBJ and MTL --------------------------------------------------------------------------------------------------

RAMP = np.repeat(np.uint8([[[0], [40], [80], [40]]]), 3, axis=2)  # a roof: up, up, down, down
SLOPE = 40 / 255  # in heights per texel, at its sides


def obj_quad(folder: Path, line: str, *, image: Any = RAMP, vn: bool = True) -> Path:
    (folder / "map.png").write_bytes(png(image))
    (folder / "a.mtl").write_text(f"newmtl Wall\nKd 0.5 0.5 0.5\n{line}\n")
    rows = [f"v {x} {y} {z}" for x, y, z in QUAD.tolist()]
    rows += [f"vt {u} {1 - v}" for u, v in QUAD_UVS.tolist()] + (["vn 0 0 1"] if vn else [])
    rows += ["mtllib a.mtl", "usemtl Wall", "f " + " ".join(f"{k}/{k}/{'1' if vn else ''}" for k in range(1, 5))]
    (folder / "a.obj").write_text("\n".join(rows) + "\n")
    return folder / "a.obj"


def slopes(scene: Scene) -> Any:
    """(height, width, 2) slopes -x / z and -y / z of the first normal map, times its scale."""
    first, width, height = scene.textures[scene.normal_texture[0]]
    codes = scene.texels[first : first + width * height, :3].reshape(height, width, 3) / 127.5 - 1
    return -codes[..., :2] / codes[..., 2:] * scene.normal_scale[0]


@pytest.mark.parametrize("key", ["map_Bump", "bump", "map_bump"])
def test_heights_become_normals(tmp_path: Path, key: str) -> None:
    scene = read(obj_quad(tmp_path, f"{key} -bm 2.5 map.png"))
    # half a code value of a normal is 0.004 of its slope
    assert slopes(scene)[0, :, 0] == pytest.approx(2.5 * SLOPE * np.array([0, 1, 0, -1]), abs=2.5 * 0.006)
    assert slopes(scene)[0, :, 1] == pytest.approx(np.zeros(4), abs=2.5 * 0.006)
    assert tangents_of(scene) == [[1, 0, 0, 1]]
    assert "height maps are taken as normals, with heights in texels: Wall" in scene.report.notes


def test_heights_upwards_in_the_picture_lean_down(tmp_path: Path) -> None:
    scene = read(obj_quad(tmp_path, "map_Bump map.png", image=np.swapaxes(RAMP, 0, 1)))
    # row 0 is on top: from row 0 to row 2 the height falls with v
    assert slopes(scene)[:, 0, 1] == pytest.approx(-SLOPE * np.array([0, 1, 0, -1]), abs=0.006)


def test_light_greys_are_heights_though_their_length_is_1(tmp_path: Path) -> None:
    """(201, 201, 201) is nearly a unit vector."""
    scene = read(obj_quad(tmp_path, "map_Bump map.png", image=RAMP // 8 + 196))
    assert any("heights" in note for note in scene.report.notes)


@pytest.mark.parametrize("line", ["norm map.png", "map_Bump -bm 0.5 map.png", "map_Bump gone.png\nnorm map.png"])
def test_an_image_of_normals_is_taken_as_it_is(tmp_path: Path, line: str) -> None:
    random = np.random.default_rng(4).normal(size=(8, 8, 3))
    normal = abs(random) * [1, 1, 3] / np.linalg.norm(random * [1, 1, 3], axis=2, keepdims=True)
    image = np.rint((normal + 1) * 127.5).astype(np.uint8)
    scene = read(obj_quad(tmp_path, line, image=image))
    assert scene.texels[:, :3].tolist() == image.reshape(-1, 3).tolist()
    assert scene.normal_scale.tolist() == [0.5 if "-bm" in line else 1.0]
    assert not scene.report.notes


def test_maps_of_an_obj_file_need_no_normals(tmp_path: Path) -> None:
    scene = read(obj_quad(tmp_path, "map_Bump -s -2 3 1 -o 0.5 0 0 map.png", vn=False))
    assert scene.normal_uvs[0].tolist() == [[0, 0], [1, 0], [1, 1]]
    assert tangents_of(scene) == [[1, 0, 0, 1]]
    assert "options of maps (-o, -s) are left out: Wall" in scene.report.notes


def test_maps_of_an_obj_file_are_left_out_with_a_note(tmp_path: Path) -> None:
    scene = load_scene(obj_quad(tmp_path, "map_Bump map.png"))
    assert scene.report.notes == ('normal maps are left out; scene.surfaces = "file" uses them: Wall',)
    assert not len(scene.tangents) and not len(scene.textures)


# --- overrides ----------------------------------------------------------------------------------------------------


def test_a_strength_multiplies_slopes(tmp_path: Path) -> None:
    file = mapped_quad(tmp_path, {"scale": 0.5})
    strong = load_scene(file, {"Wall": MaterialTable(normal_strength=3.0)}, as_file=True)
    assert strong.normal_scale.tolist() == [1.5]
    none = load_scene(file, {"Wall": MaterialTable(normal_strength=0.0)}, as_file=True)
    assert (none.normal_texture.tolist(), none.report.normal_maps) == ([-1], 0)
    kept = load_scene(file, {"Wall": MaterialTable(reflectivity=[0.1, 0.1, 0.1])}, as_file=True)
    assert kept.normal_texture.tolist() == [0]


def test_a_strength_without_a_map_is_noted(tmp_path: Path) -> None:
    file = quad_of("Wall").save(tmp_path / "a.glb")
    scene = load_scene(file, {"Wall": MaterialTable(normal_strength=3.0)}, as_file=True)
    assert scene.report.notes == ("normal_strength changes nothing where there is no normal map: Wall",)


def test_a_strength_is_not_negative() -> None:
    with pytest.raises(ValidationError):
        MaterialTable(normal_strength=-1.0)


SQUARE = tiny.quad((0, 0, 0), (2, 0, 0), (2, 1, 0), (0, 1, 0))
UVS = np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]], np.float64)


def unit(vector: Any) -> Any:
    return vector / np.linalg.norm(vector)


def angle(a: Any, b: Any) -> float:
    return float(np.arccos(np.clip(unit(a) @ unit(b), -1, 1)))


def slowly(corners: Any, normals: Any, uvs: Any) -> Any:
    """As MikkTSpace has it: for each corner a loop over all corners that are the same vertex, one line per formula."""
    found = np.zeros((len(corners), 3, 4))

    def flat(f: int, normal: Any) -> Any:
        """Where u grows on triangle f, in the plane of a normal."""
        edges = np.stack([corners[f, 1] - corners[f, 0], corners[f, 2] - corners[f, 0]])
        along_u, _ = np.linalg.solve(np.stack([uvs[f, 1] - uvs[f, 0], uvs[f, 2] - uvs[f, 0]]), edges)
        return unit(along_u - along_u @ normal * normal)

    def turns(f: int) -> float:
        (a, b), (c, d) = uvs[f, 1] - uvs[f, 0], uvs[f, 2] - uvs[f, 0]
        return float(np.sign(a * d - b * c))

    for f in range(len(corners)):
        for k in range(3):
            vertex, n, total = (corners[f, k], uvs[f, k]), unit(normals[f, k]), np.zeros(3)
            for g in range(len(corners)):
                for j in range(3):
                    same = (corners[g, j] == vertex[0]).all() and (uvs[g, j] == vertex[1]).all()
                    if not same or (normals[g, j] != normals[f, k]).any() or turns(f) != turns(g):
                        continue
                    edges = [corners[g, i] - corners[g, j] for i in range(3) if i != j]
                    one, other = (edge - edge @ n * n for edge in edges)
                    total += angle(one, other) * flat(g, n)
            found[f, k] = [*unit(total), turns(f)]
    return found


def test_a_quad_has_its_edges() -> None:
    for normals in (None, np.broadcast_to([0.0, 0, 3], SQUARE.shape)):
        assert compute_tangents(SQUARE, normals, UVS).reshape(-1, 4) == pytest.approx(np.array([[1, 0, 0, 1]] * 6))


@pytest.mark.parametrize(
    ("matrix", "expected"),
    [
        ([[-1, 0], [0, 1]], [-1, 0, 0, -1]),  # the picture mirrored, left to right
        ([[1, 0], [0, -1]], [1, 0, 0, -1]),  # upside down
        ([[-1, 0], [0, -1]], [-1, 0, 0, 1]),  # turned by half
        ([[0, 1], [-1, 0]], [0, -1, 0, 1]),  # turned by a quarter: u grows where v did fall
        ([[5, 0], [0, 0.01]], [1, 0, 0, 1]),  # stretched
    ],
)
def test_pictures_that_are_mirrored_and_turned(matrix: Any, expected: Any) -> None:
    found = compute_tangents(SQUARE, None, UVS @ np.array(matrix, np.float64))
    assert found.reshape(-1, 4) == pytest.approx(np.array([expected] * 6))


def test_a_smooth_ball_is_that_of_the_slow_twin() -> None:
    """On one half of the ball the picture is mirrored; corners between the halves have a tangent for each."""
    corners, normals = tiny.ball((0.1, 0.2, 0.3), 0.7, 4)
    corners, normals = corners[:, ::-1], normals[:, ::-1]  # their order shows the outside
    x, y, z = np.moveaxis(normals, -1, 0)
    uvs = np.stack([abs(np.arctan2(x, z)) + 0.3 * y, y - 0.2 * x * z], axis=-1)
    found = compute_tangents(corners, normals, uvs)
    assert {-1.0, 1.0} == set(found[..., 3].ravel())
    assert found == pytest.approx(slowly(corners, normals, uvs), abs=1e-9)
    assert abs((found[..., :3] * normals).sum(axis=-1)).max() < 1e-9


def test_the_bitangent_is_where_v_grows_even_if_corners_run_the_other_way() -> None:
    """On models whose normals point to the back of their triangles, too."""
    for order in (slice(None), slice(None, None, -1)):
        found = compute_tangents(SQUARE[:, order], np.broadcast_to([0.0, 0, 1], SQUARE.shape), UVS[:, order]).reshape(
            -1, 4
        )
        assert (found[:, 3:] * np.cross([0, 0, 1], found[:, :3])) == pytest.approx(np.array([[0, 1, 0]] * 6))


def test_triangles_without_texture_area_take_part_in_their_neighbours() -> None:
    flat = UVS.copy()
    flat[1] = UVS[0, 0]  # the second triangle shows one point of the texture, that of the corner it shares
    found = compute_tangents(SQUARE, None, flat)
    assert found[0] == pytest.approx(np.array([[1, 0, 0, 1]] * 3))
    assert found[1, 0] == pytest.approx([1, 0, 0, 1])
    assert not found[1, 1:].any()


@pytest.mark.parametrize("broken", ["corners", "normals", "uvs"])
def test_what_has_no_direction_is_zero(broken: str) -> None:
    arrays = {"corners": SQUARE.copy(), "normals": np.broadcast_to([0.0, 0, 1], SQUARE.shape).copy(), "uvs": UVS.copy()}
    arrays[broken][0] = np.nan
    found = compute_tangents(**arrays)
    assert found[0].any() == (broken == "normals")  # the triangle's own stand in
    assert np.isfinite(found).all()
    assert found[1, 2] == pytest.approx([1, 0, 0, 1])
    assert (compute_tangents(SQUARE, np.zeros_like(SQUARE), UVS) == compute_tangents(SQUARE, None, UVS)).all()
    assert compute_tangents(np.zeros((0, 3, 3)), None, np.zeros((0, 3, 2))).shape == (0, 3, 4)
