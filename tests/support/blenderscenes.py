"""Run by a Python with bpy: small scenes, what Cycles renders of them, and their jobs by the script that is shipped.

python blenderscenes.py SCRIPT FOLDER NAME ...
"""

import importlib.util
import json
import sys
from pathlib import Path

import bpy

SAMPLES = 256  # of Cycles; the noise of a mean over 80 x 60 pixels is far below a hundredth
LIGHTS = {
    "point": ("POINT", {"energy": 100, "shadow_soft_size": 0.1}),
    "raw": ("POINT", {"energy": 100, "shadow_soft_size": 0.2, "normalize": False}),
    "warm": ("POINT", {"energy": 50, "use_temperature": True, "temperature": 3000, "exposure": 0.5}),
    "sun": ("SUN", {"energy": 3, "angle": 0.1, "color": (1, 0.5, 0.2)}),
    "spot": ("SPOT", {"energy": 100, "spot_size": 1.0, "spot_blend": 0.3, "shadow_soft_size": 0.05}),
    "panel": ("AREA", {"energy": 50, "shape": "RECTANGLE", "size": 1.0, "size_y": 0.3}),
    "disk": ("AREA", {"energy": 50, "shape": "DISK", "size": 0.8}),
}


def scene_of_a_floor():
    """A white square of 4 x 4 under a camera that looks down on it, without any light."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("dark")
    scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0
    bpy.ops.mesh.primitive_plane_add(size=4)
    white = bpy.data.materials.new("white")
    shader = white.node_tree.nodes["Principled BSDF"] if white.node_tree else None
    if shader is None:
        white.use_nodes = True
        shader = white.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (1, 1, 1, 1)
    shader.inputs["Roughness"].default_value = 1
    shader.inputs["Specular IOR Level"].default_value = 0
    bpy.context.object.data.materials.append(white)
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    scene.collection.objects.link(camera)
    camera.location = (0, 0, 4)
    scene.camera = camera
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = 80, 60
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.max_bounces = SAMPLES, False, 0
    scene.frame_end = 1
    return scene


def lamp(scene, kind, values):
    """Add a light above the floor."""
    data = bpy.data.lights.new("lamp", kind)
    for key, value in values.items():
        setattr(data, key, value)
    thing = bpy.data.objects.new("lamp", data)
    thing.location, thing.rotation_euler = (0.4, 0.3, 1.5), (0.2, 0.1, 0.3)
    scene.collection.objects.link(thing)
    return thing


def walk(scene, folder):
    """Let the camera and a lamp move; write where they are at every frame, by key frames as Blender evaluates them."""
    thing = lamp(scene, "POINT", {"energy": 10})
    scene.frame_end, scene.render.fps = 5, 30
    for moving, end in ((scene.camera, (1, 0, 3)), (thing, (-1, 0.5, 2))):
        moving.keyframe_insert("location", frame=1)
        moving.location = end
        moving.keyframe_insert("location", frame=5)
    known = {"fps": 30.0, "eyes": [], "lamps": []}
    for frame in range(1, 6):
        scene.frame_set(frame)
        known["eyes"].append(list(scene.camera.matrix_world.translation))
        known["lamps"].append(list(thing.matrix_world.translation))
    (folder / "walk.json").write_text(json.dumps(known))


def main():
    script, folder = Path(sys.argv[1]), Path(sys.argv[2])
    spec = importlib.util.spec_from_file_location("framearray_export", script)
    export = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(export)
    for name in sys.argv[3:]:
        scene = scene_of_a_floor()
        if name == "walk":
            walk(scene, folder)
        else:
            lamp(scene, *LIGHTS[name])
            scene.render.image_settings.file_format = "OPEN_EXR"
            scene.render.filepath = str(folder / f"{name}.exr")
            bpy.ops.render.render(write_still=True)
        job = folder / f"{name}.toml"
        export.Export(export.read_options([str(job), "--format", "exr"])).write(job)


if __name__ == "__main__":
    main()
