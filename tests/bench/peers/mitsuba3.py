"""The same images from Mitsuba 3, where it is installed: every image from scratch, the same number of the same rays.

14 eye rays per pixel, at each hit 5 rays over the hemisphere, as long as the range of the obscurances, and one shadow
ray per light source; everything in one compiled pass of the LLVM backend, on the same triangles. It does without the
rest of the program: mirrors, alpha masks, interpolated normals and texture filtering.
"""

import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from bench.core.cases import SCRATCH, Case, job_named, open_case, with_lights, with_settings
from bench.core.frames import frame
from bench.core.machine import busy
from bench.core.results import Table
from bench.core.steady import steady
from bench.speed.processes import asked_of_mitsuba
from bench.speed.speed import FORMATS, WRITTEN
from bench.truth.mitsuba import COMPILED, find_mitsuba
from framearray_cli.array.images import write_image
from framearray_cli.engine.terms.obscurance import FALLOFFS

HITS, RAYS = int(SCRATCH.settings.hits), SCRATCH.settings.obscurance
PLACES = ((0.25, 1 / 6), (0.5, 1 / 2), (0.75, 5 / 6))  # of the camera path and of the light path


def measure(name: str, quick: bool) -> Table:
    """The cost of an image of a job, in a process of its own."""
    return asked_of_mitsuba("mitsuba-here", name, quick=quick)


def measure_here(name: str, quick: bool) -> Table:
    """Seconds per image of Mitsuba; {"skipped": why} where that cannot be had."""
    mi, why = find_mitsuba()
    if why:
        return {"skipped": why}
    mi.set_variant(COMPILED)
    with open_case(job_named(name, quick)) as case:
        if case.setup.indirect.settings.falloff != FALLOFFS["sqrt"]:
            return {"skipped": "the integrator knows only the falloff sqrt"}
        image = integrator(mi, case)
        n_c, n_l = case.setup.n_frames, case.setup.lights.n_lights
        where = [(int(a * n_c), int(b * n_l)) for a, b in PLACES]
        first = image(*where[0])  # compiles
        shares, spent, written = [busy()], [], []
        with tempfile.TemporaryDirectory() as folder:
            for i in range(1 if quick else 3):
                for c, l in where:
                    started = time.perf_counter()
                    made = image(c, l)
                    spent.append(time.perf_counter() - started)
                    write_image(Path(folder) / f"{i}-{c}-{l}.exr", made, FORMATS[WRITTEN])
                    written.append(time.perf_counter() - started)
                shares.append(busy())
        ours = steady(with_lights(with_settings(case, SCRATCH.settings), [where[0][1]]), 1, place=PLACES[0][0])
        return {
            "version": mi.__version__,
            "ms": 1e3 * float(np.median(spent)),
            "written_ms": 1e3 * float(np.median(written)),
            "mean": float(first.mean()),
            "our_mean": _our_mean(case, *where[0]),
            "our_ms": ours.ms,
            "busy": shares,
        }


def _our_mean(case: Case, c: int, l: int) -> float:
    """Mean radiance of the program's own image, to see that both make the same picture but for mirrors."""
    one = with_lights(with_settings(case, SCRATCH.settings), [l])
    return float(frame(one, c, seed=1).images.mean())


def integrator(mi: Any, case: Case) -> Callable[[int, int], Any]:
    """A function (c, l) -> image, (h, w, 3), on the LLVM backend."""
    import drjit as dr

    setup, s = case.setup, case.setup.world.surfaces
    scene = _scene(mi, s.corners)
    cams, lights, settings = setup.cams, setup.lights, setup.indirect.settings
    n_pixels = cams.width * cams.height
    reflectivity_of = _reflectivity(mi, dr, s)
    average, background = mi.Color3f(settings.average.tolist()), mi.Color3f(setup.background.tolist())
    d_max = float(settings.d_max)

    def image(c: int, l: int) -> Any:
        def vector(values: Any) -> Any:
            found = mi.Vector3f(*(float(value) for value in values))
            dr.make_opaque(found)
            return found

        eye, right, up, forward = (vector(a[c]) for a in (cams.position, cams.right, cams.up, cams.forward))
        ambient = vector(case.ambient.intensity[l])
        random = mi.PCG32(size=n_pixels * HITS, initstate=dr.opaque(mi.UInt64, 1 + c * 4096 + l))
        pixel = dr.arange(mi.UInt32, n_pixels * HITS) // HITS
        x = (mi.Float(pixel % cams.width) + random.next_float32() - 0.5 * cams.width) / cams.focal
        y = (0.5 * cams.height - mi.Float(pixel // cams.width) - random.next_float32()) / cams.focal
        ray = mi.Ray3f(mi.Point3f(eye), dr.normalize(x * right + y * up + forward))
        found = scene.ray_intersect_preliminary(ray, coherent=True)
        valid = found.is_valid()
        hit = found.compute_surface_interaction(ray, mi.RayFlags.Minimal | mi.RayFlags.dNSdUV, valid)
        n = dr.select(dr.dot(hit.n, ray.d) > 0, -hit.n, hit.n)
        r = reflectivity_of(found.prim_index, found.prim_uv, valid)
        p = hit.p + 1e-4 * n
        frame = mi.Frame3f(n)
        w = mi.Color3f(0)
        for _ in range(RAYS):
            disc = mi.warp.square_to_uniform_disk_concentric(mi.Point2f(random.next_float32(), random.next_float32()))
            height = 1 - dr.squared_norm(disc)
            # not `maximum`: older LLVMs cannot compile it
            local = mi.Vector3f(disc.x, disc.y, dr.sqrt(dr.select(height > 0, height, 0)))
            near = scene.ray_intersect_preliminary(mi.Ray3f(p, frame.to_world(local), d_max, 0, []), False, valid)
            met = valid & near.is_valid()
            open_to = dr.sqrt(near.t / d_max)
            w += dr.select(met, reflectivity_of(near.prim_index, near.prim_uv, met) * open_to, average)
        light = mi.Color3f(0)
        for source in range(len(lights.kind)):
            to, strength = vector(lights.vector[source, :, l]), lights.strength[source, :, l] * lights.colour[l]
            power = vector(np.broadcast_to(strength, 3))
            if lights.kind[source] == 1:
                towards, far, weight = -to, mi.Float(1e30), mi.Float(1)
            else:
                towards = to - p
                far = dr.norm(towards)
                weight = 1 / dr.square(far)
                towards /= far
            cosine = dr.dot(n, towards)
            blocked = scene.ray_test(mi.Ray3f(p, towards, far * 0.9999, 0, []), True, valid & (cosine > 0))
            light += dr.select((cosine > 0) & ~blocked, cosine * weight, 0) * mi.Color3f(power)
        shown = dr.select(valid, r * (light / dr.pi + mi.Color3f(ambient) * w / RAYS), background) / HITS
        dr.eval(shown.x, shown.y, shown.z)  # else each channel would trace all rays for itself
        sums = [dr.block_reduce(dr.ReduceOp.Add, channel, HITS) for channel in (shown.x, shown.y, shown.z)]
        dr.eval(*sums)
        return np.stack([np.array(channel, np.float32) for channel in sums], -1).reshape(cams.height, cams.width, 3)

    return image


def _scene(mi: Any, corners: Any) -> Any:
    mesh = mi.Mesh("scene", vertex_count=3 * len(corners), face_count=len(corners))
    params = mi.traverse(mesh)
    params["vertex_positions"] = np.ascontiguousarray(corners).ravel()
    params["faces"] = np.arange(3 * len(corners), dtype=np.uint32)
    params.update()
    return mi.load_dict({"type": "scene", "mesh": mesh})


def _reflectivity(mi: Any, dr: Any, s: Any) -> Callable[[Any, Any, Any], Any]:
    """Reflectivity by triangle and place, textures unfiltered."""
    material, factor = mi.UInt32(s.material.astype(np.uint32)), mi.Float(s.reflectivity.ravel())
    texture = mi.Int32(s.reflectivity_texture)
    textured = bool(len(s.uvs)) and bool((s.reflectivity_texture >= 0).any())
    if textured:
        uvs = mi.Float(s.uvs.ravel())
        texels = mi.Float(s.linear[s.texels[:, :3]].ravel())
        first, width, height = (mi.UInt32(s.textures[:, i].astype(np.uint32)) for i in range(3))

    def of(triangle: Any, uv: Any, active: Any) -> Any:
        m = dr.gather(mi.UInt32, material, triangle, active)
        r = dr.gather(mi.Color3f, factor, m, active)
        if textured:
            t = dr.gather(mi.Int32, texture, m, active)
            shows = active & (t >= 0)
            a, b, c = (dr.gather(mi.Point2f, uvs, 3 * triangle + i, shows) for i in range(3))
            at = (1 - uv.x - uv.y) * a + uv.x * b + uv.y * c
            at -= dr.floor(at)
            t = mi.UInt32(dr.maximum(t, 0))
            w, h = dr.gather(mi.UInt32, width, t, shows), dr.gather(mi.UInt32, height, t, shows)
            column = dr.minimum(mi.UInt32(at.x * mi.Float(w)), w - 1)
            row = dr.minimum(mi.UInt32((1 - at.y) * mi.Float(h)), h - 1)
            texel = dr.gather(mi.UInt32, first, t, shows) + row * w + column
            r = dr.select(shows, r * dr.gather(mi.Color3f, texels, texel, shows), r)
        return r

    return of
