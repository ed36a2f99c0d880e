"""Meshes that move, at one time: skins and morph targets of glTF and USD, and moved nodes.

The same figure is posed by the reader of glTF and by usd-core. Its two joints turn by quarters of a turn, and its
corners follow both.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.scenes import Glb
from support.staged import QUARTER, animate
from support.usdfiles import instancer, mesh, new_stage, pxr, save

from framearray_cli.scene.files import read_meshes

POINTS = np.array([[0, 0, 0], [1, 0, 0], [1, 2, 0], [0, 2, 0]], np.float32)
FACES = np.array([[0, 1, 2], [0, 2, 3]], np.uint16)
NORMALS = np.array([[0, 0, 1], [0, 0.6, 0.8], [0.6, 0, 0.8], [0, 0, 1]], np.float32)
UP = np.array([[0, 0, 1], [0, 0, 0], [0, 0.5, 0], [0, 0, 0]], np.float32)  # a morph target
ELBOW = (0.0, 1.0, 0.0)  # place of the second joint in the first, of bind pose and pose
WEIGHTS = np.array([[1, 0], [0.75, 0.25], [0.25, 0.75], [0, 2]], np.float32)  # the last does not add up to 1
TURN = [[0, 0, 0, 1], [QUARTER, 0, 0, QUARTER]]  # about x, x y z w


def corners_of(file: Path, time: float | None) -> tuple[Any, Any, tuple[str, ...]]:
    """Corners and normals of the only part, and the notes."""
    found = read_meshes(file, time=time)
    (part,) = found.parts
    return part.corners.reshape(-1, 3), part.normals.reshape(-1, 3) if part.normals is not None else None, found.notes


def figure(folder: Path) -> Path:
    """The figure as GLB: its node stands elsewhere, which does not count; both joints turn from 1 s to 3 s."""
    glb = Glb()
    padded = np.pad(WEIGHTS, ((0, 0), (0, 2)))
    shape = glb.mesh(
        positions=POINTS,
        faces=FACES.ravel(),
        NORMAL=glb.accessor(NORMALS),
        JOINTS_0=glb.accessor(np.array([[0, 1, 0, 0]] * 4, np.uint8)),
        WEIGHTS_0=glb.accessor(padded),
    )
    glb.tree["meshes"][shape]["primitives"][0]["targets"] = [{"POSITION": glb.accessor(UP)}]
    lower = glb.add("nodes", {"translation": ELBOW})
    upper = glb.root(glb.add("nodes", {"children": [lower]}))
    bind = np.tile(np.eye(4, dtype=np.float32), (2, 1, 1))
    bind[1, :3, 3] = ELBOW
    inverse = np.linalg.inv(bind).transpose(0, 2, 1).reshape(-1, 16)
    skin = glb.add("skins", {"joints": [upper, lower], "inverseBindMatrices": glb.accessor(inverse)})
    node = glb.node(shape, skin=skin, translation=[50.0, 0.0, 0.0])
    for joint in (upper, lower):
        animate(glb, joint, "rotation", [1.0, 3.0], TURN)
    animate(glb, node, "weights", [1.0, 3.0], [0.0, 2.0])
    return glb.save(folder / "a.glb")


def usd_figure(folder: Path, motion_at: str = "/World/Root/A") -> Path:
    """The figure as USD; its animation is at a path."""
    library = pxr()
    skel, gf, stage = library.UsdSkel, library.Gf, new_stage(folder / "a.usda")
    skel.Root.Define(stage, "/World/Root")
    shape = mesh(stage, "/World/Root/M", POINTS, [3, 3], FACES.ravel().tolist())
    shape.CreateNormalsAttr([tuple(map(float, normal)) for normal in NORMALS])
    shape.SetNormalsInterpolation("vertex")
    skeleton = skel.Skeleton.Define(stage, "/World/Root/S")
    skeleton.CreateJointsAttr(["a", "a/b"])
    bind = [gf.Matrix4d(1), gf.Matrix4d().SetTranslate(ELBOW)]
    skeleton.CreateBindTransformsAttr(bind)
    skeleton.CreateRestTransformsAttr(bind)
    motion = skel.Animation.Define(stage, motion_at)
    motion.CreateJointsAttr(["a", "a/b"])
    motion.CreateTranslationsAttr([(0, 0, 0), ELBOW])
    motion.CreateScalesAttr([(1, 1, 1)] * 2)
    motion.CreateBlendShapesAttr(["up"])
    turns, weights = motion.CreateRotationsAttr(), motion.CreateBlendShapeWeightsAttr()
    for code, (x, y, z, w), weight in zip((24.0, 72.0), TURN, (0.0, 2.0), strict=True):
        turns.Set([gf.Quatf(w, x, y, z)] * 2, code)
        weights.Set([weight], code)
    skel.BindingAPI.Apply(skeleton.GetPrim()).CreateAnimationSourceRel().SetTargets([motion_at])
    binding = skel.BindingAPI.Apply(shape.GetPrim())
    binding.CreateSkeletonRel().SetTargets(["/World/Root/S"])
    binding.CreateJointIndicesPrimvar(False, 2).Set([0, 1] * 4)
    binding.CreateJointWeightsPrimvar(False, 2).Set((WEIGHTS / WEIGHTS.sum(axis=1, keepdims=True)).ravel().tolist())
    target = skel.BlendShape.Define(stage, "/World/Root/M/up")
    target.CreateOffsetsAttr([tuple(map(float, change)) for change in UP])
    binding.CreateBlendShapesAttr(["up"])
    binding.CreateBlendShapeTargetsRel().SetTargets(["/World/Root/M/up"])
    return save(stage)


def test_a_figure_stands_as_its_joints_turn_it(tmp_path: Path) -> None:
    """At the end both joints have turned by a quarter about x, one after the other: closed form per corner."""
    corners, normals, notes = corners_of(figure(tmp_path), 3.0)
    first = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    second = first @ first
    expected = []
    for point, change, (a, b) in zip(POINTS, UP, WEIGHTS / WEIGHTS.sum(axis=1, keepdims=True), strict=True):
        p = point + 2 * change
        expected.append(a * (first @ p) + b * (second @ (p - ELBOW) + first @ ELBOW))
    np.testing.assert_allclose(corners, np.array(expected)[np.ravel(FACES)], atol=1e-6)
    np.testing.assert_allclose(normals[[0, 5]], [first @ [0, 0, 1], second @ [0, 0, 1]], atol=1e-6)
    assert "meshes that move are shown at 3 s of 1 to 3 s; scene.time selects another time" in notes


def test_without_a_time_it_is_the_start(tmp_path: Path) -> None:
    """There the pose is the bind pose, and before the first key it stays."""
    for time in (None, -7.0):
        corners, normals, _ = corners_of(figure(tmp_path), time)
        np.testing.assert_allclose(corners, POINTS[np.ravel(FACES)], atol=1e-6)
        np.testing.assert_allclose(
            normals / np.linalg.norm(normals, axis=1)[:, None], NORMALS[np.ravel(FACES)], atol=1e-6
        )


@pytest.mark.parametrize("motion_at", ["/World/Root/A", "/World/Motions/A"])
@pytest.mark.parametrize("time", [None, 1.0, 1.7, 2.0, 3.0, 4.0])
def test_the_reader_of_gltf_and_usd_core_agree(tmp_path: Path, time: float | None, motion_at: str) -> None:
    """Points to float32, also between keys. Normals of corners with two joints differ: usd-core has another mean."""
    corners, normals, _ = corners_of(figure(tmp_path), time)
    same, theirs, notes = corners_of(usd_figure(tmp_path, motion_at), time)
    np.testing.assert_allclose(corners, same, atol=2e-6)
    for k in (0, 5):
        np.testing.assert_allclose(
            normals[k] / np.linalg.norm(normals[k]), theirs[k] / np.linalg.norm(theirs[k]), atol=2e-6
        )
    assert any(note.startswith("meshes that move are shown at ") for note in notes)


@pytest.mark.parametrize("how", ["instance", "instancer"])
def test_copies_of_a_usd_figure_are_posed(tmp_path: Path, how: str) -> None:
    library = pxr()
    usd_figure(tmp_path)
    stage = new_stage(tmp_path / "b.usda")
    if how == "instance":
        for k in range(2):
            copy = stage.DefinePrim(f"/World/I{k}", "Xform")
            copy.GetReferences().AddReference("a.usda")
            copy.SetInstanceable(True)
            library.UsdGeom.XformCommonAPI(copy).SetTranslate((10.0 * k, 0.0, 0.0))
    else:
        instancer(stage, "/World/Many", "/World/Many/P", [(0.0, 0.0, 0.0), (10.0, 0.0, 0.0)])
        stage.DefinePrim("/World/Many/P", "Xform").GetReferences().AddReference("a.usda")
    corners = np.concatenate([part.corners.reshape(-1, 3) for part in read_meshes(save(stage), time=3.0).parts])
    one, _, _ = corners_of(tmp_path / "a.usda", 3.0)
    np.testing.assert_allclose(corners, np.concatenate([one, one + np.array([10, 0, 0])]), atol=1e-5)


def test_default_weights_count_without_an_animation(tmp_path: Path) -> None:
    """The node's before the mesh's; two nodes show one mesh in two shapes."""
    glb = Glb()
    shape = glb.mesh(positions=POINTS, faces=FACES.ravel(), NORMAL=glb.accessor(NORMALS))
    change = {"POSITION": glb.accessor(UP), "NORMAL": glb.accessor(UP)}
    glb.tree["meshes"][shape] |= {"weights": [0.5]}
    glb.tree["meshes"][shape]["primitives"][0]["targets"] = [change]
    glb.node(shape)
    glb.node(shape, weights=[2.0])
    found = read_meshes(glb.save(tmp_path / "a.glb"))
    for part, weight in zip(found.parts, (0.5, 2.0), strict=True):
        assert part.normals is not None
        np.testing.assert_allclose(part.corners.reshape(-1, 3), (POINTS + weight * UP)[np.ravel(FACES)])
        np.testing.assert_allclose(part.normals.reshape(-1, 3), (NORMALS + weight * UP)[np.ravel(FACES)], atol=1e-7)
    assert not any("move" in note for note in found.notes)


def test_moved_nodes_stand_where_they_are_at_the_time(tmp_path: Path) -> None:
    glb = Glb()
    node = glb.node(glb.mesh(positions=POINTS, faces=FACES.ravel()))
    animate(glb, node, "translation", [0.0, 2.0], [[0, 0, 0], [4, 0, 0]])
    corners, _, _ = corners_of(glb.save(tmp_path / "a.glb"), 0.5)
    np.testing.assert_allclose(corners, POINTS[np.ravel(FACES)] + (1, 0, 0), atol=1e-6)


def test_usd_times_are_seconds_from_time_code_0(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "a.usda")
    shape = mesh(stage, "/World/M", POINTS, [4], [0, 1, 2, 3])
    move = pxr().UsdGeom.Xformable(shape).AddTranslateOp()
    for code, x in ((12.0, 1.0), (36.0, 3.0)):
        move.Set((x, 0.0, 0.0), code)
    stage.SetStartTimeCode(12.0)
    stage.SetEndTimeCode(36.0)
    file = save(stage)
    for time, x, said in ((None, 1.0, "0.5"), (1.0, 2.0, "1")):
        corners, _, notes = corners_of(file, time)
        assert corners[:, 0].min() == pytest.approx(x)
        assert f"meshes that move are shown at {said} s of 0.5 to 1.5 s; scene.time selects another time: M" in notes
