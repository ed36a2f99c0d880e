"""Run by a Python with bpy: small scenes, what Cycles renders of them, and their jobs by the script that is shipped.

python blenderscenes.py SCRIPT FOLDER NAME ...
"""

import importlib.util
import json
import math
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


def view(scene, name):
    """Look at the floor under a lamp through a lens that is not the plain one."""
    lamp(scene, *LIGHTS["point"])
    camera, render = scene.camera.data, scene.render
    camera.shift_x = 0.1
    if name == "orthographic":
        camera.type, camera.ortho_scale = "ORTHO", 3.0
    elif name == "stretched":
        render.pixel_aspect_x = 2.0
    elif name == "panorama":
        camera.type, camera.panorama_type, camera.shift_x = "PANO", "EQUIRECTANGULAR", 0.0
        scene.camera.location, scene.camera.rotation_euler = (0, -0.5, 1), (math.pi / 2, 0, 0.5)
        render.resolution_x = 2 * render.resolution_y


def zoom(scene, folder):
    """Let the focal length change, and say which field of view it is."""
    lamp(scene, *LIGHTS["point"])
    camera, scene.frame_end = scene.camera.data, 3
    for frame, lens in ((1, 30.0), (3, 60.0)):
        camera.lens = lens
        camera.keyframe_insert("lens", frame=frame)
    known = []
    for frame in range(1, 4):
        scene.frame_set(frame)
        known.append(math.degrees(2 * math.atan(camera.sensor_width * 60 / 80 / 2 / camera.lens)))
    (folder / "zoom.json").write_text(json.dumps(known))


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
        if name in ("walk", "zoom"):
            {"walk": walk, "zoom": zoom}[name](scene, folder)
        else:
            if name in LIGHTS:
                lamp(scene, *LIGHTS[name])
            else:
                view(scene, name)
            scene.render.image_settings.file_format = "OPEN_EXR"
            scene.render.filepath = str(folder / f"{name}.exr")
            bpy.ops.render.render(write_still=True)
        job = folder / f"{name}.toml"
        export.Export(export.read_options([str(job), "--format", "exr"])).write(job)


if __name__ == "__main__":
    main()
