"""The nasty set: every file is a scene or one clear error; where its note says what is in it, that is what is read."""

import json
from importlib.util import find_spec

import numpy as np
import pytest
from support.scenes import check_shapes, scenes_folder, shared_scene

from framearray_cli.base.errors import SceneError
from framearray_cli.scene.scene import Scene, load_scene, scene_report_lines

INDEX = scenes_folder() / "nasty" / "INDEX.json"
FILES = [entry["file"] for entry in json.loads(INDEX.read_text())] if INDEX.is_file() else []

# file -> a part of its error; every other file is a scene
ERRORS = {
    "trimesh/empty.obj": "expected triangles",
    "trimesh/empty.ply": "expected triangles",
    "trimesh/empty.stl": "expected triangles",
    "trimesh/empty_nodes.glb": "expected triangles",
    "trimesh/emptyIO/obj_points.obj": "points without faces",
    "trimesh/emptyIO/obj_wireframe.obj": "lines",
    "trimesh/points_emptyface.ply": "points and lines",
    "trimesh/face_in_group_name.obj": "points without faces",
    "trimesh/blue_cube.dae": "pycollada",
    "assimp/glTF2/BoxWithInfinites-glTF-Binary/BoxWithInfinites.glb": "non-finite",
    "assimp/glTF2/IndexOutOfRange/AllIndicesOutOfRange.gltf": "index out of range",
    "assimp/glTF2/IncorrectVertexArrays/Cube.gltf": "broken",
    "assimp/glTF2/MissingBin/BoxTextured.gltf": "BoxTextured0.bin",
    "assimp/glTF2/RecursiveNodes/RecursiveNodes.gltf": "cycle",
    "assimp/glTF2/TestNoRootNode/NoScene.gltf": "expected a scene",
    "assimp/glTF2/wrongTypes/badArray.gltf": "primitives: expected a list, got an object",
    "assimp/invalid/empty.ply": "empty file",
    "assimp/invalid/OutOfMemory.off": "broken",
    "assimp/OBJ/number_formats.obj": "1 degenerate",
    "assimp/OFF/invalid.off": "expected triangles",
    "playcanvas/heart_draco.glb": "Draco",
}
# with this package installed the file is a scene
OPTIONAL = {"trimesh/blue_cube.dae": "collada", "playcanvas/heart_draco.glb": "DracoPy"}


def nasty(name: str) -> Scene:
    return load_scene(shared_scene(f"nasty/{name}"))


def size(scene: Scene) -> list[float]:
    return np.ptp(scene.corners.astype(np.float64), axis=(0, 1)).tolist()


def area(scene: Scene) -> float:
    edges = scene.corners[:, 1:].astype(np.float64) - scene.corners[:, :1]
    return float(np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1).sum() / 2)


def closed(scene: Scene) -> bool:
    """Whether every edge has two triangles, once in each direction."""
    _, index = np.unique(np.round(scene.corners.reshape(-1, 3), 5), axis=0, return_inverse=True)
    faces = index.reshape(-1, 3)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).tolist()
    return len(edges) == len({tuple(e) for e in edges}) and {(a, b) for a, b in edges} == {(b, a) for a, b in edges}


@pytest.mark.skipif(not FILES, reason="no nasty set; set FRAMEARRAY_SCENES to the folder of scenes")
def test_errors_are_of_files_in_the_set():
    assert set(ERRORS) <= set(FILES)


@pytest.mark.parametrize("name", FILES)
def test_a_scene_or_one_clear_error(name, capfd):
    file = shared_scene(f"nasty/{name}")
    if name in ERRORS and not (name in OPTIONAL and find_spec(OPTIONAL[name])):
        with pytest.raises(SceneError, match=ERRORS[name]) as caught:
            load_scene(file)
        assert str(file) in str(caught.value)
        assert "\n" not in str(caught.value)
    else:
        scene = load_scene(file)
        check_shapes(scene)
        assert scene_report_lines(scene.report, name)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("name", "triangles", "extent"),
    [
        ("trimesh/negative_indices.obj", 12, None),
        ("trimesh/BoxInterleaved.glb", 12, [1, 1, 1]),
        ("assimp/OBJ/box_UTF16BE.obj", 12, None),
        ("assimp/OBJ/cube_with_vertexcolors.obj", 12, None),
        ("assimp/PLY/cube_binary_starts_with_nl.ply", 12, None),
        ("assimp/OBJ/cube_usemtl.obj", 12, None),
        ("trimesh/rgb_cube_with_primitives.gltf", 12, None),
        ("assimp/glTF2/BoxBadNormals-glTF-Binary/BoxBadNormals.glb", 12, [1, 1, 1]),
        ("online3dviewer/obj/cube_with_materials_comments.obj", 12, [1, 1, 1]),
    ],
)
def test_cubes_are_cubes(name, triangles, extent):
    scene = nasty(name)
    assert scene.report.triangles == triangles
    sides = np.array(size(scene))
    assert sides == pytest.approx(np.full(3, sides[0]))
    assert area(scene) == pytest.approx(6 * sides[0] ** 2)
    assert closed(scene)
    if extent is not None:
        assert sides == pytest.approx(extent)


def test_relative_indices_of_the_cornell_box_match_the_plain_file():
    ours = nasty("CornellBox-Original.obj")
    plain = load_scene(shared_scene("cornell_box/cornell_box.obj"))
    assert size(ours) == pytest.approx(size(plain), abs=1e-6)
    assert ours.report.triangles in (plain.report.triangles, 36)
    red = ours.reflectivity[ours.material_names.index("leftWall")]
    assert red == pytest.approx([0.63, 0.065, 0.05])


def test_every_gpu_instance_is_there():
    assert nasty("playcanvas/simple-instancing.glb").report.triangles == 125 * 12


def test_sparse_accessor_moves_three_vertices():
    scene = nasty("online3dviewer/gltf/SimpleSparseAccessor/glTF-Embedded/SimpleSparseAccessor.gltf")
    assert (scene.corners + scene.centre).max(axis=(0, 1)).tolist() == [6, 4, 0]


def test_dropped_triangles_are_counted():
    assert nasty("trimesh/capsule.obj").report.dropped == {"degenerate": 200}
    spider = nasty("assimp/STL/Spider_ascii.stl").report
    assert spider.dropped["degenerate"] == 56
    assert spider.triangles + sum(spider.dropped.values()) == 1368
    line = nasty("assimp/OBJ/box_longline.obj").report
    assert line.triangles + sum(line.dropped.values()) == 944
    assert nasty("assimp/glTF2/IndexOutOfRange/IndexOutOfRange.gltf").report.dropped == {"index out of range": 1}


def test_windows_paths_and_spaces_find_their_textures():
    assert nasty("assimp/OBJ/spider.obj").report.textures == 4
    assert nasty("trimesh/fuze.obj").report.textures == 1


def test_alpha_modes():
    scene = nasty("trimesh/AlphaBlendModeTest.glb")
    cutoff = dict(zip(scene.material_names, scene.alpha_cutoff.tolist(), strict=True))
    expected = {"MatCutoff25": 0.25, "MatCutoff75": 0.75, "MatCutoffDefault": 0.5, "MatBlend": 0.5, "MatOpaque": 0.0}
    assert {name: cutoff[name] for name in expected} == expected
    assert 0 < scene.n_opaque < scene.report.triangles


def test_vertex_colours_arrive():
    assert len(nasty("trimesh/cubevc.glb").colours) == 48
    assert len(nasty("online3dviewer/gltf/BoxVertexColors/glTF-Binary/BoxVertexColors.glb").colours) == 12
    triangle = nasty("assimp/PLY/float-color.ply")
    assert triangle.colours.max() > 0
    white = (nasty("trimesh/nancolor.obj").colours == 1).all(axis=-1)
    assert white.any()  # the NaN ones
    assert not white.all()


def test_concave_polygon_has_a_hole():
    scene = nasty("assimp/OBJ/concave_polygon.obj")
    edges = scene.corners[:, 1:].astype(np.float64) - scene.corners[:, :1]
    normal = np.cross(edges[:, 0], edges[:, 1])
    assert np.linalg.norm(normal.sum(axis=0)) / 2 == pytest.approx(area(scene), rel=1e-3)  # nothing folds over


def test_notes_say_what_is_left_out():
    def notes(name: str) -> str:
        return "\n".join(nasty(name).report.notes)

    assert "skins" in notes("assimp/glTF2/simple_skin/simple_skin.gltf")
    assert "image.jpg" in notes("assimp/OBJ/mtl_different_folder.obj")
    assert "points and lines" in notes("playcanvas/PrimitiveModeNormalsTest.glb")
    assert "clamp" in notes("assimp/glTF2/textureTransform/TextureTransformTest.gltf")
