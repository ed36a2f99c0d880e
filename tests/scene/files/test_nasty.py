"""Files that are broken, claim the impossible or lead elsewhere: each is a scene or one clear error."""

import io
import os
import time
import zipfile
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from support import movies
from support.nasty import nasty_files
from support.scenes import area_vectors, check_shapes, scenes_folder, shared_scene

from framearray_cli.array.images import read_image
from framearray_cli.array.integrity import find_damage
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.array.record import Entry, RecordedRun, RecordWriter, read_records, record_file, seal
from framearray_cli.base.errors import OutputError, SceneError
from framearray_cli.base.openimage import last_row
from framearray_cli.engine.images.standard_error import standard_error
from framearray_cli.scene.files import read_meshes
from framearray_cli.scene.files.assets import Limit
from framearray_cli.scene.files.other import check_headers
from framearray_cli.scene.scene import Scene, load_scene, scene_report_lines

FILES = nasty_files(scenes_folder())

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
    "assimp/glTF2/MissingBin/BoxTextured.gltf": "BoxTextured0.bin",
    "assimp/glTF2/RecursiveNodes/RecursiveNodes.gltf": "cycle",
    "assimp/glTF2/TestNoRootNode/NoScene.gltf": "expected a scene",
    "assimp/glTF2/wrongTypes/badArray.gltf": "primitives: expected a list of tables, got a table",
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
    return float(np.linalg.norm(area_vectors(scene.corners.astype(np.float64)), axis=1).sum())


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
    normal = area_vectors(scene.corners.astype(np.float64))
    assert np.linalg.norm(normal.sum(axis=0)) == pytest.approx(area(scene), rel=1e-3)  # nothing folds over


def test_notes_say_what_is_left_out():
    def notes(name: str) -> str:
        return "\n".join(nasty(name).report.notes)

    assert "scene.time" in notes("assimp/glTF2/simple_skin/simple_skin.gltf")
    assert "image.jpg" in notes("assimp/OBJ/mtl_different_folder.obj")
    assert "points and lines" in notes("playcanvas/PrimitiveModeNormalsTest.glb")
    assert "clamp" not in notes("assimp/glTF2/textureTransform/TextureTransformTest.gltf")


PRINT = "sha256:0"
GOOD = {"c": 0, "lights": [0, 2], "files": {"a.exr": [4, "0"]}, "hits": 1.0, "rays": {"native": 5}, "seconds": 2.0}


def write(folder: Path, *lines: dict) -> None:
    """A record of one session with lines sealed as the program seals them."""
    file = record_file(folder, "0-1")
    file.parent.mkdir(exist_ok=True)
    head = {"fingerprint": PRINT, "cameras": "0-1", "processor": "p"}
    file.write_bytes(b"\n".join(map(seal, (head, *lines))) + b"\n")


def test_a_good_line_counts(tmp_path: Path) -> None:
    write(tmp_path, GOOD)
    records = read_records(tmp_path, PRINT)
    assert records.entries == (Entry(c=0, lights=(0, 2), files={"a.exr": (4, "0")}, hits=1.0),)
    assert records.runs == (RecordedRun(cameras="0-1", processor="p", rays={"native": 5}, seconds=2.0),)


@pytest.mark.parametrize(
    "wrong",
    [
        {"lights": [0, 10**12]},
        {"lights": [-1, 2]},
        {"lights": [2, 0]},
        {"c": -1},
        {"c": 10**9},
        {"c": float("inf")},
        {"hits": 10**400},
        {"files": {"../secret": [4, "0"]}},
        {"files": {"/dev/zero": [0, "0"]}},
        {"files": {"a\\b": [0, "0"]}},
        {"files": {"a\0": [0, "0"]}},
        {"files": {"..": [0, "0"]}},
        {"files": {"": [0, "0"]}},
    ],
)
def test_a_line_that_no_render_writes_does_not_count(tmp_path: Path, wrong: dict) -> None:
    write(tmp_path, GOOD | wrong)
    assert read_records(tmp_path, PRINT).entries == ()


@pytest.mark.parametrize(
    "wrong", [{"rays": [1]}, {"rays": {"native": "x"}}, {"seconds": "x"}, {"seconds": []}, {"seconds": float("nan")}]
)
def test_rays_and_seconds_of_a_session_count_where_they_are_recorded(tmp_path: Path, wrong: dict) -> None:
    write(tmp_path, GOOD | wrong)
    records = read_records(tmp_path, PRINT)
    assert len(records.entries) == 1
    assert records.runs[0].rays == ({} if "rays" in wrong else {"native": 5})
    assert records.runs[0].seconds == (0.0 if "seconds" in wrong else 2.0)


def test_what_the_program_writes_is_what_it_reads(tmp_path: Path) -> None:
    entry = Entry(
        c=3, lights=(1, 4), files={"Ω é.exr": (1 << 40, "ab")}, hits=0.5, notes=("x",), errors={1: (1e-30, 2.0)}
    )
    with RecordWriter(record_file(tmp_path, "0-3"), PRINT, RecordedRun(cameras="0-3", processor="p")) as record:
        record.add(entry, {"native": 7}, 1.5)
    records = read_records(tmp_path, PRINT)
    assert records.entries == (entry,)
    assert records.runs == (RecordedRun(cameras="0-3", processor="p", rays={"native": 7}, seconds=1.5),)


@pytest.mark.skipif(os.name == "nt", reason="pipes and devices are no files there")
@pytest.mark.parametrize("kind", ["pipe", "device", "folder"])
def test_what_has_no_end_is_not_read(tmp_path: Path, kind: str) -> None:
    def place(path: Path) -> Path:
        path.parent.mkdir(exist_ok=True)
        if kind == "pipe":
            os.mkfifo(path)
        elif kind == "device":
            path.symlink_to("/dev/zero")
        else:
            path.mkdir()
        return path

    with pytest.raises(OutputError, match=r"expected a file, got a folder or a device|no such file"):
        read_manifest(place(tmp_path / "manifest.toml"))
    with pytest.raises(OutputError, match="expected a file, got a folder or a device"):
        place(record_file(tmp_path, "0-1"))
        read_records(tmp_path, PRINT)
    for name in ("a.png", "a.jpg", "a.exr", "a.tif"):
        path = place(tmp_path / name)
        with pytest.raises(OutputError, match=r"a\.\w+: (expected a file|no such file)"):
            read_image(path)
        assert name[-3:] in ("png", "jpg") or last_row(path) is None
        assert list(find_damage(tmp_path, {name: (0, "0")}, [name])) == [(name, "is no file")]


def test_a_whole_array_is_read(tmp_path: Path) -> None:
    """The checks above pass a good array."""
    manifest = movies.plain(tmp_path, 1, 1, "exr")
    assert read_manifest(tmp_path) == manifest
    assert read_image(tmp_path / "tiny.c0000.l000.exr").shape[1::-1] == manifest.resolution


def test_the_error_of_what_is_very_bright_is_finite() -> None:
    rng = np.random.default_rng(1)
    difference = rng.standard_normal((8, 9, 3)).astype(np.float32)
    hits = np.full((8, 9), 7, np.int32)
    plain = standard_error(difference, hits)
    assert np.array_equal(standard_error(difference * np.float32(2.0**100), hits), plain * np.float32(2.0**100))
    assert np.array_equal(standard_error(np.zeros_like(difference), hits), np.zeros_like(difference))


PLY = """ply
format {} 1.0
element vertex {}
property float x
property {} y
property float z
element face 1
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
3 0 1 2
"""
BROKEN = {
    "ply": [PLY.format("binary_little_endian", 10**12, "float"), PLY.format("ascii", 3, "quad"), PLY[:100], ""],
    "off": ["OFF\n", "OFF\n3000000000000 1 0\n0 0 0\n", "OFF\n-3 1 0\n"],
}


@pytest.mark.parametrize(("suffix", "text"), [(suffix, text) for suffix, texts in BROKEN.items() for text in texts])
def test_broken_ply_and_off_are_one_error(tmp_path: Path, suffix: str, text: str) -> None:
    file = tmp_path / f"a.{suffix}"
    file.write_text(text)
    with pytest.raises(SceneError) as caught:
        read_meshes(file)
    assert str(caught.value).startswith((f"{file}: broken, or not {suffix.upper()} (", f"{file}: expected "))
    (tmp_path / "b.ply").write_text(PLY.format("ascii", 3, "float"))
    assert len(read_meshes(tmp_path / "b.ply").parts[0].corners) == 1


def test_many_solids_of_an_stl_are_one_mesh(tmp_path: Path) -> None:
    """trimesh took 2.3 s for 4,000 of them, and twice as many took three times as long."""
    facet = "facet normal 0 0 1\nouter loop\nvertex {0} 0 0\nvertex {0} 1 0\nvertex {0} 0 1\nendloop\nendfacet\n"
    file = tmp_path / "a.stl"
    file.write_text("".join(f"solid part {k}\n{facet.format(k)}endsolid part {k}\n\n" for k in range(20_000)))
    started = time.perf_counter()
    (part,) = read_meshes(file).parts
    assert time.perf_counter() - started < 5
    assert len(part.corners) == 20_000
    assert part.corners[:, 0, 0].tolist() == list(range(20_000))


def packed(**files: bytes) -> bytes:
    """A ZIP."""
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return data.getvalue()


def test_what_an_archive_unpacks_to_counts() -> None:
    data = packed(model=bytes(50 * 2**20), more=bytes(50 * 2**20))
    assert len(data) < 2**20
    check_headers(data, "3mf", Limit(most=2**27))
    with pytest.raises(SceneError, match=r"unpacked files 100\.0 MiB\), 64\.0 MiB may be used"):
        check_headers(data, "3mf", Limit(most=2**26))


ENTITY = '<?xml version="1.0"?><!DOCTYPE a [<!ENTITY b SYSTEM "file:///etc/passwd">]><a>&b;</a>'


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "utf-32"])
def test_entities_of_xml_are_refused(encoding: str) -> None:
    data = ENTITY.encode(encoding)
    for extension, content in (("dae", data), ("xaml", data), ("3mf", packed(model=data)), ("zae", packed(a=data))):
        with pytest.raises(SceneError, match="defines XML entities, which are refused"):
            check_headers(content, extension, Limit())
    check_headers(ENTITY.replace('[<!ENTITY b SYSTEM "file:///etc/passwd">]', "").encode(encoding), "dae", Limit())
