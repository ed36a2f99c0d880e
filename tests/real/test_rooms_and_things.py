"""Rooms and things: what `init` takes scenes of other people for, scored by labels made by looking at them."""

from pathlib import Path

import pytest
from support import ROOT
from support.scenes import scenes_folder, suites_folder

from framearray_cli.base.errors import SceneError
from framearray_cli.scene.files import read_stage
from framearray_cli.scene.scene import load_scene
from framearray_cli.starter import StartOptions
from framearray_cli.starter.lighting import AllNames
from framearray_cli.starter.site import explored, surroundings
from framearray_cli.starter.walks import choose_walk

LEAST = 0.95  # share of right answers
THINGS = {
    "trimesh": """20mm-xyz-cube.stl 7_8ths_cube.stl BoxTextured.glb CesiumMilkTruck.glb P_XPM_0331_01.3mf
    angle_block.STL ballA.off ballB.off blue_cube.dae boolean.glb box.STL box.obj bunny.ply
    chair_model.obj counterXP.3MF cube.OBJ cube.glb cube_and_sphere_same_name.3mf cylinder.stl duck.dae
    fandisk.obj featuretype.STL fixed_top.ply fuze.obj idler_riser.STL jacked.obj large_block.STL
    monkey.glb multibody.stl nested.glb not_convex.obj octagonal_pocket.ply octagonal_pocket.stl
    origin_inside.STL pins.glb plate_holes.STL pyramids.3mf quadknot.obj rabbit.obj round.stl shared.STL
    simple_pole.glb suzanne.ply target.obj teapot.stl testplate.glb tet.ply torus.STL tube.obj
    two_objects.obj unit_cube.STL unit_sphere.STL""",
    "assimp": """OBJ/WusonOBJ.obj OBJ/spider.obj PLY/Wuson.ply PLY/cube.ply STL/3DSMaxExport.STL STL/sphereWithHole.stl
    glTF2/draco/2CylinderEngine.gltf glTF2/BoxTextured-glTF-Binary/BoxTextured.glb""",
    "khronos": """AnimatedCube/*/*.gltf Box/*/*.glb BoxAnimated/*/*.glb CesiumMan/*/*.glb Cube/*/*.gltf Duck/*/*.glb
    Fox/*/*.glb MetalRoughSpheresNoTextures/*/*.glb RiggedFigure/*/*.glb SimpleInstancing/*/*.glb""",
    "usd": """intent-vfx/assets/simpleAsset/simpleAsset.usd intent-vfx/assets/teapot/teapot.usd
    full_assets/McUsd/McUsd.usda test_assets/USDZ/CesiumMan/CesiumMan.usdz""",
}
ROOMS = """cornell_box/cornell_box.obj grey_white_room/grey_white_room.glb iss_kibo_cabin/iss_kibo_cabin.glb
modern_hall/modern_hall.glb modern_hall_obj/modern_hall.obj vr_gallery/vr_gallery.glb
country_kitchen/country_kitchen.glb"""
OWN = [ROOT / "jobs" / "scenes" / f"{name}.glb" for name in ("cabin", "kitchen", "stairs")]

UPRIGHT = {  # what stands upright with which axis
    "y": """trimesh/bunny.ply trimesh/chair_model.obj trimesh/rabbit.obj trimesh/reference.obj trimesh/reference.ply
    trimesh/suzanne.ply trimesh/target.obj assimp/OBJ/WusonOBJ.obj assimp/OBJ/spider.obj assimp/PLY/Wuson.ply
    assimp/STL/Wuson.stl fbx/ufbx/blender_282_suzanne.obj fbx/ufbx/blender_340_mirrored_normals.obj
    fbx/ufbx/max6_teapot.obj fbx/ufbx/maya_axes.obj fbx/ufbx/revit_wall_square.obj cornell_box/cornell_box.obj
    modern_hall_obj/modern_hall.obj""",
    "z": """trimesh/busted.STL trimesh/fuze.obj trimesh/fuze.ply trimesh/teapot.stl assimp/OBJ/regr01.obj
    assimp/STL/Spider_ascii.stl fbx/ufbx/max2009_blob.obj fbx/ufbx/synthetic_color_suzanne.obj
    utah_teapot/utah_teapot.stl""",
}
LEAST_UPRIGHT = 0.85  # faces and heads without a base stand on neither side


def labelled() -> dict[Path, bool]:
    """Labelled files that exist, with True for rooms."""
    found = {file: True for file in [*OWN, *(scenes_folder() / name for name in ROOMS.split())]}
    for suite, names in THINGS.items():
        found |= dict.fromkeys(
            [file for name in names.split() for file in sorted((suites_folder() / suite).glob(name))], False
        )
    # a house of several rooms is seen from outside
    found |= {scenes_folder() / name: False for name in ("utah_teapot/utah_teapot.stl", "duplex/duplex.glb")}
    return {file: room for file, room in found.items() if file.exists()}


def is_room(file: Path) -> bool:
    """True if `init` takes a scene for a room; the eyes of its walk are then inside."""
    scene, stage = load_scene(file, shining=AllNames(), as_file=True), read_stage(file)
    with explored(scene, file, StartOptions(), stage) as site:
        if site.room is None:
            return False
        walk = choose_walk(site.probe, site.room, site.metre)
        if walk is not None:
            assert surroundings(site.probe, walk[:, 0], site.room.enclosed)[0].all(), file
            low, high = scene.corners.min(axis=(0, 1)), scene.corners.max(axis=(0, 1))
            assert ((walk[:, 0] > low) & (walk[:, 0] < high)).all(), file
        return walk is not None and not site.room.roofless


@pytest.mark.slow
@pytest.mark.skipif(not suites_folder().is_dir(), reason="set FRAMEARRAY_SUITES to the folder of test suites")
def test_rooms_are_told_from_things() -> None:
    right, wrong = 0, []
    for file, room in labelled().items():
        try:
            found = is_room(file)
        except SceneError:  # a reader that is not installed
            continue
        right += found == room
        wrong += [str(file)] * (found != room)
    total = right + len(wrong)
    assert total >= 60 and right >= LEAST * total, f"{right} of {total}; wrong: {wrong}"


@pytest.mark.skipif(not suites_folder().is_dir(), reason="set FRAMEARRAY_SUITES to the folder of test suites")
def test_scenes_stand_upright() -> None:
    right, wrong = 0, []
    folders = (suites_folder(), scenes_folder())
    labels = {folder / name: up for up, names in UPRIGHT.items() for name in names.split() for folder in folders}
    for file, up in labels.items():
        if file.exists():
            with explored(load_scene(file), file, StartOptions(inside=False), read_stage(file)) as site:
                right += "xyz"[site.up] == up
                wrong += [str(file)] * ("xyz"[site.up] != up)
    total = right + len(wrong)
    assert total >= 20 and right >= LEAST_UPRIGHT * total, f"{right} of {total}; wrong: {wrong}"
