"""Surfaces of USD files: polygons, subsets, instances, solids, visibility, and what a broken one is reported as."""

from pathlib import Path

import numpy as np
import pytest
from support.scenes import area_vectors
from support.usdfiles import bind, coordinates, instancer, mesh, new_stage, preview, pxr, save

from framearray_cli.base.errors import SceneError
from framearray_cli.scene.files import read_meshes

pytest.importorskip("pxr", reason="usd-core is not installed (extra usd)")


def test_polygons_are_cut_into_triangles_that_face_the_same_way(tmp_path: Path) -> None:
    """A concave pentagon, a triangle, a hole and a face with a point that does not exist."""
    stage = new_stage(tmp_path / "a.usda")
    points = [(0, 0, 0), (4, 0, 0), (4, 4, 0), (2, 1, 0), (0, 4, 0), (9, 0, 0)]
    shape = mesh(stage, "/World/M", points, [5, 3, 3, 3], [0, 1, 2, 3, 4, 0, 1, 5, 0, 1, 2, 0, 1, 77])
    shape.CreateHoleIndicesAttr([2])
    found = read_meshes(save(stage))
    (part,) = found.parts
    assert len(part.corners) == 3 + 1
    assert found.dropped == {"index out of range": 1}
    np.testing.assert_allclose(area_vectors(part.corners[:3]).sum(axis=0), (0, 0, 10))
    assert (area_vectors(part.corners[:3])[:, 2] > 0).all()


def test_left_handed_meshes_are_turned(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "a.usda")
    mesh(stage, "/World/M").CreateOrientationAttr("leftHanded")
    (part,) = read_meshes(save(stage)).parts
    np.testing.assert_allclose(area_vectors(part.corners).sum(axis=0), (0, 0, -6))


def test_subsets_have_materials_of_their_own(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "a.usda")
    red, blue = (
        preview(stage, "Red", diffuseColor=(0.8, 0.1, 0.1)),
        preview(stage, "Blue", diffuseColor=(0.1, 0.1, 0.8)),
    )
    cells = [(x, y, 0) for y in (0, 1) for x in (0, 1, 2, 3)]
    shape = mesh(stage, "/World/M", cells, [4] * 3, [0, 1, 5, 4, 1, 2, 6, 5, 2, 3, 7, 6])
    bind(shape.GetPrim(), red)
    subset = pxr().UsdShade.MaterialBindingAPI(shape).CreateMaterialBindSubset("middle", [1])
    bind(subset.GetPrim(), blue)
    found = read_meshes(save(stage))
    by_name = {found.materials[part.material].name: part.corners for part in found.parts}
    assert {name: len(corners) for name, corners in by_name.items()} == {"Red": 4, "Blue": 2}
    assert by_name["Blue"][..., 0].min() == 1 and by_name["Blue"][..., 0].max() == 2
    assert found.materials[0].reflectivity == pytest.approx((0.8, 0.1, 0.1))


def test_instances_and_point_instancers_place_every_copy(tmp_path: Path) -> None:
    """Two instances of a prototype, and an instancer of three places, one masked by its ids, below a scaled parent."""
    library = pxr()
    stage = new_stage(tmp_path / "a.usda")
    stage.CreateClassPrim("/Proto")
    mesh(stage, "/Proto/M")
    for k in range(2):
        prim = stage.DefinePrim(f"/World/I{k}", "Xform")
        prim.GetReferences().AddInternalReference("/Proto")
        prim.SetInstanceable(True)
        library.UsdGeom.XformCommonAPI(prim).SetTranslate((10.0 * k, 0.0, 0.0))
    many = instancer(stage, "/World/Many", "/World/Many/P/Card", [(0.0, 0.0, z) for z in (5.0, 6.0, 7.0)])
    mesh(stage, "/World/Many/P/Card")
    many.CreateIdsAttr([1, 2, 3])
    many.InvisId(2, library.Usd.TimeCode.Default())
    library.UsdGeom.XformCommonAPI(many).SetScale((2.0, 2.0, 2.0))
    instanced, copied = read_meshes(save(stage)).parts
    assert len(instanced.corners) == len(copied.corners) == 4
    np.testing.assert_allclose(instanced.corners[2:] - instanced.corners[:2], np.broadcast_to([10, 0, 0], (2, 3, 3)))
    assert sorted(set(copied.corners[..., 2].ravel())) == [10, 14]
    np.testing.assert_allclose(np.abs(area_vectors(copied.corners)[:, 2]).sum(), 2 * 6 * 4)


def test_what_is_hidden_or_for_guides_only_is_left_out(tmp_path: Path) -> None:
    library = pxr()
    stage = new_stage(tmp_path / "a.usda")
    shown = mesh(stage, "/World/Shown")
    library.UsdGeom.XformCommonAPI(shown).SetTranslate((1.0, 2.0, 3.0))
    library.UsdGeom.Imageable(mesh(stage, "/World/Off/M").GetPrim().GetParent()).GetPrim().SetTypeName("Xform")
    library.UsdGeom.Xform(stage.GetPrimAtPath("/World/Off")).MakeInvisible()
    for purpose in ("guide", "proxy"):
        mesh(stage, f"/World/{purpose}").CreatePurposeAttr(purpose)
    (part,) = read_meshes(save(stage)).parts
    np.testing.assert_allclose(part.corners.min(axis=(0, 1)), (1, 2, 3))


@pytest.mark.parametrize(("axis", "extent"), [("X", (6, 2, 2)), ("Y", (2, 6, 2)), ("Z", (2, 2, 6))])
def test_solids_become_triangles(tmp_path: Path, axis: str, extent: tuple[int, ...]) -> None:
    library = pxr()
    stage = new_stage(tmp_path / "a.usda")
    tube = library.UsdGeom.Cylinder.Define(stage, "/World/Tube")
    tube.CreateRadiusAttr(1.0)
    tube.CreateHeightAttr(6.0)
    tube.CreateAxisAttr(axis)
    tube.CreateDisplayColorAttr([(0.1, 0.2, 0.3)])
    found = read_meshes(save(stage))
    (part,) = found.parts
    np.testing.assert_allclose(np.ptp(part.corners, axis=(0, 1)), extent, rtol=0.01)
    outwards = (area_vectors(part.corners) * part.corners.mean(axis=1)).sum(axis=1)
    assert (outwards > 0).all()
    assert part.colours is not None and part.colours[0, 0] == pytest.approx((0.1, 0.2, 0.3))


def test_values_of_every_interpolation_reach_the_corners(tmp_path: Path) -> None:
    """The same texture coordinates, by corner, by point and with a wrong number of them."""
    from framearray_cli.scene.files.assets import Assets
    from framearray_cli.scene.files.materials import TexturePlaces
    from framearray_cli.scene.files.model import Notes
    from framearray_cli.scene.files.usd.meshes import read_surface

    stage, time = new_stage(tmp_path / "a.usda"), pxr().Usd.TimeCode.Default()
    st, found = [(0, 0), (1, 0), (1, 1), (0, 1)], []
    for name, interpolation, values in (("a", "faceVarying", st), ("b", "vertex", st), ("c", "vertex", st[:3])):
        shape = mesh(stage, f"/World/{name}")
        coordinates(shape, values, interpolation)
        surface = read_surface(shape.GetPrim(), time, Assets(folder=tmp_path).limit, Notes())
        assert surface is not None
        found.append(surface.texture_coordinates(TexturePlaces()))
    np.testing.assert_array_equal(found[:2], [st, st])
    assert found[2] is None


def test_an_instancer_that_holds_itself_is_one_error(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "a.usda")
    instancer(stage, "/World/Group/Many", "/World/Group", [(0.0, 0.0, 0.0)])
    mesh(stage, "/World/Group/M")
    with pytest.raises(SceneError, match=r"a\.usda: /World/Group/Many: the point instancer holds itself"):
        read_meshes(save(stage))


@pytest.mark.parametrize("suffix", ["usda", "usdc", "usdz"])
def test_broken_files_are_one_error_and_print_nothing(
    tmp_path: Path, suffix: str, capfd: pytest.CaptureFixture
) -> None:
    file = tmp_path / f"a.{suffix}"
    file.write_bytes({"usda": b"#usda 1.0\ndef {{", "usdc": b"PXR-USDC" + b"\xff" * 90, "usdz": b"PK\x03\x04"}[suffix])
    with pytest.raises(SceneError) as caught:
        read_meshes(file)
    assert f"a.{suffix}: broken, or not {suffix.upper()} (" in str(caught.value)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("how", ["sublayer", "reference", "payload"])
def test_layers_elsewhere_are_refused(tmp_path: Path, how: str) -> None:
    inner = tmp_path / "inner"
    inner.mkdir()
    mesh(new := new_stage(tmp_path / "secret.usda"), "/World/M")
    save(new)
    stage = new_stage(inner / "a.usda")
    if how == "sublayer":
        stage.GetRootLayer().subLayerPaths.append("../secret.usda")
    elif how == "reference":
        stage.GetPrimAtPath("/World").GetReferences().AddReference("../secret.usda")
    else:
        stage.GetPrimAtPath("/World").GetPayloads().AddPayload("../secret.usda")
    with pytest.raises(SceneError, match=r"refused to read \.\./secret\.usda: it lies outside"):
        read_meshes(save(stage))


@pytest.mark.parametrize("name", ["//server/share/a.usda", "https://example.com/a.usda", "/home/nowhere/a.usda"])
def test_layers_of_other_machines_are_missing(tmp_path: Path, name: str) -> None:
    stage = new_stage(tmp_path / "a.usda")
    mesh(stage, "/World/M")
    stage.GetRootLayer().subLayerPaths.append(name)
    found = read_meshes(save(stage))
    assert len(found.parts) == 1
    assert any(name in note and "are missing" in note for note in found.notes)


def test_missing_layers_and_cycles_are_notes(tmp_path: Path) -> None:
    """What is there is shown; a file that refers to itself has itself once more, and no further."""
    stage = new_stage(tmp_path / "a.usda")
    mesh(stage, "/World/M")
    prim = stage.DefinePrim("/World/Other")
    prim.GetReferences().AddReference("gone.usda")
    stage.DefinePrim("/World/Loop").GetReferences().AddReference("a.usda")
    found = read_meshes(save(stage))
    assert "files that it names are missing: gone.usda" in found.notes
    assert any("Cycle detected" in note and "0x" not in note for note in found.notes)
    assert sum(len(part.corners) for part in found.parts) == 2 * 2


def test_layers_that_cannot_be_read_are_one_note_per_kind(tmp_path: Path, capfd: pytest.CaptureFixture) -> None:
    """Another format, broken layers, and value clips, which would move the mesh."""
    stage = new_stage(tmp_path / "a.usda")
    shape = mesh(stage, "/World/M").GetPrim()
    stage.GetRootLayer().subLayerPaths.append("bad.usda")
    stage.DefinePrim("/World/Looks").GetReferences().AddReference("look.abc", "/MaterialX")
    stage.DefinePrim("/World/Old").GetPayloads().AddPayload("old.usdc")
    for name, text in (
        ("bad.usda", "#usda 1.0\ndef {{"),
        ("look.abc", "Ogawa"),
        ("old.usdc", "PXR-USDC" + "x" * 90),
    ):
        (tmp_path / name).write_text(text)
    points = "point3f[] points"
    (tmp_path / "manifest.usda").write_text(f'#usda 1.0\nover "M" {{\n {points}\n}}\n')
    far = "[(0, 0, 9), (2, 0, 9), (2, 3, 9), (0, 3, 9)]"
    (tmp_path / "clip.usda").write_text(f'#usda 1.0\nover "M" {{\n {points}.timeSamples = {{ 0: {far} }}\n}}\n')
    clips = pxr().Usd.ClipsAPI(shape)
    clips.SetClipAssetPaths([pxr().Sdf.AssetPath("./clip.usda")])
    clips.SetClipManifestAssetPath(pxr().Sdf.AssetPath("./manifest.usda"))
    clips.SetClipPrimPath("/M")
    clips.SetClipActive([(0, 0)])
    file = save(stage)
    capfd.readouterr()  # the stage of the test warns, too
    found = read_meshes(file)
    assert np.ptp(found.parts[0].corners, axis=(0, 1)).tolist() == [2, 3, 0] and found.parts[0].corners.max() == 3
    broken, formats, clipped = found.notes[:3]
    assert formats == "files of other formats than USD are left out: look.abc"
    assert broken.startswith("layers that are broken are left out: bad.usda (") and ", old.usdc (" in broken
    assert clipped == "value clips are left out; usdcat --flatten joins them: M"
    assert not any("USD says" in note for note in found.notes)
    assert capfd.readouterr() == ("", "")


def test_without_usd_core_the_message_says_how_to_install_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    from framearray_cli.scene.files.usd.usdcore import usd

    usd.cache_clear()
    monkeypatch.setitem(sys.modules, "pxr", None)
    (tmp_path / "a.usda").write_text("#usda 1.0\n")
    with pytest.raises(SceneError, match=r"reading USD files needs usd-core; export the scene as GLB, or install it"):
        read_meshes(tmp_path / "a.usda")
    usd.cache_clear()
