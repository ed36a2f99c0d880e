"""The same views in Blender Cycles, where its Python module `bpy` is installed: path tracing, every image from scratch.

Cycles computes another model, all light by paths, so this is the cost of an image of about the same number of samples
there, not that pictures are the same: 14 samples per pixel on the processor, no denoising, its own default bounces,
diffuse materials with the mean colour of their texture.
"""

import contextlib
import os
import time
from typing import Any

import numpy as np

from bench.core.cases import SCRATCH, Case, job_named, open_case
from bench.core.machine import busy
from bench.core.results import Table

PLACES = ((0.25, 1 / 6), (0.5, 1 / 2), (0.75, 5 / 6))  # of the camera path and of the light path


def measure(name: str, quick: bool) -> Table:
    """Milliseconds per image of Cycles; {"skipped": why} where that cannot be had."""
    try:
        import bpy
    except ImportError:
        return {"skipped": "Blender's module is not installed (pip install bpy)"}
    with open_case(job_named(name, quick)) as case:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        camera, lamps = _scene(bpy, case)
        shares, spent = [busy()], []
        for i, (a, b) in enumerate(((0.1, 0.1), *PLACES)):  # the first one is not timed
            _place(case, camera, lamps, int(a * case.setup.n_frames), int(b * case.setup.lights.n_lights))
            started = time.perf_counter()
            with _silent():
                bpy.ops.render.render()
            if i:
                spent.append(time.perf_counter() - started)
                shares.append(busy())
        return {"version": bpy.app.version_string, "ms": 1e3 * float(np.median(spent)), "busy": shares}


@contextlib.contextmanager
def _silent() -> Any:
    """Blender prints its progress from C."""
    kept, nowhere = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)


def _scene(bpy: Any, case: Case) -> tuple[Any, list[Any]]:
    """One mesh with its materials, a camera and the lamps; coordinates as the program's kernels have them."""
    s, lights, cams = case.setup.world.surfaces, case.setup.lights, case.setup.cams
    n = len(s.corners)
    mesh = bpy.data.meshes.new("scene")
    mesh.vertices.add(3 * n)
    mesh.vertices.foreach_set("co", np.ascontiguousarray(s.corners, np.float32).ravel())
    mesh.loops.add(3 * n)
    mesh.loops.foreach_set("vertex_index", np.arange(3 * n, dtype=np.int32))
    mesh.polygons.add(n)
    mesh.polygons.foreach_set("loop_start", np.arange(0, 3 * n, 3, dtype=np.int32))
    for m in range(len(s.reflectivity)):
        mesh.materials.append(_material(bpy, m, s))
    mesh.polygons.foreach_set("material_index", s.material.astype(np.int32))
    mesh.update()
    scene = bpy.context.scene
    scene.collection.objects.link(bpy.data.objects.new("scene", mesh))
    camera = bpy.data.objects.new("eye", bpy.data.cameras.new("eye"))
    camera.data.sensor_fit, camera.data.angle = "VERTICAL", 2 * np.arctan(0.5 * cams.height / cams.focal)
    scene.collection.objects.link(camera)
    scene.camera = camera
    lamps = []
    for kind in lights.kind:
        lamp = bpy.data.objects.new("lamp", bpy.data.lights.new("lamp", "SUN" if kind == 1 else "POINT"))
        scene.collection.objects.link(lamp)
        lamps.append(lamp)
    scene.world = bpy.data.worlds.new("sky")
    scene.world.color = case.setup.background[:3].tolist()
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = cams.width, cams.height
    scene.render.use_persistent_data = True
    scene.cycles.device, scene.cycles.samples = "CPU", int(SCRATCH.settings.hits)
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    return camera, lamps


def _material(bpy: Any, m: int, s: Any) -> Any:
    material = bpy.data.materials.new(str(m))
    colour = s.reflectivity[m].copy()
    if s.reflectivity_texture[m] >= 0:
        first, width, height = s.textures[s.reflectivity_texture[m]]
        colour *= s.linear[s.texels[first : first + width * height, :3]].mean(axis=0)
    material.use_nodes = True
    nodes = material.node_tree.nodes
    nodes.clear()
    diffuse, output = nodes.new("ShaderNodeBsdfDiffuse"), nodes.new("ShaderNodeOutputMaterial")
    diffuse.inputs["Color"].default_value = (*colour.tolist(), 1.0)
    material.node_tree.links.new(diffuse.outputs["BSDF"], output.inputs["Surface"])
    return material


def _place(case: Case, camera: Any, lamps: list[Any], c: int, l: int) -> None:
    """Put the camera and the lamps where they are at (c, l)."""
    from mathutils import Matrix, Vector

    cams, lights = case.setup.cams, case.setup.lights
    axes = np.stack([cams.right[c], cams.up[c], -cams.forward[c], cams.position[c]], axis=1)
    camera.matrix_world = Matrix([*axes.tolist(), [0, 0, 0, 1]])
    for source, lamp in enumerate(lamps):
        power = np.broadcast_to(lights.strength[source, :, l] * lights.colour[l], 3)
        lamp.data.color = (power / max(power.max(), 1e-9)).tolist()
        vector = Vector(lights.vector[source, :, l].tolist())
        if lamp.data.type == "SUN":
            lamp.data.energy, lamp.data.angle = float(power.max()), 0.0
            lamp.rotation_euler = vector.to_track_quat("-Z", "Y").to_euler()
        else:
            lamp.data.energy = float(power.max()) * 4 * np.pi * np.pi  # Blender's watts for a radiant intensity
            lamp.data.shadow_soft_size, lamp.location = 0.0, vector
