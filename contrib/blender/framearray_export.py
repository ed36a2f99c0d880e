"""Run by Blender: writes the scene of a .blend file as a GLB and a job of framearray.

    blender --background room.blend --python framearray_export.py -- room.toml --lights 24

The same file works with the `bpy` package: `python framearray_export.py room.toml --blend room.blend`. It needs nothing
of framearray. The GLB holds surfaces at the first frame; the job holds the camera at every frame, lights with their
sizes in Blender's own units (W, W/sr, W/m2), the world, and the size and rate of pictures. `README.md` next to this
file lists what is left out.
"""

import argparse
import json
import math
import struct
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

Row = dict[str, Any]
MOST_LIGHTS = 48  # positions of lights that move, unless --lights says otherwise
MOST_SHINING = 8  # materials that light the scene; fainter ones are only seen
NARROWEST, FLATTEST = 0.5, 90.0  # degrees from the axis of a spot, the bounds of a job
AHEAD = 2.0  # scene units from an eye to its target
LOOKS = 9  # frames whose surfaces are compared
STILL = 1e-4  # scene units; smaller movements are rounding
MOST_NAMES = 8  # in a note
SURFACES = ("MESH", "CURVE", "SURFACE", "FONT", "META")
RANGE_SHARE = 0.2  # of the size of the scene: how far obscurances look


def y_up(vector: Any) -> list[float]:
    """Turn Blender's z-up coordinates into those of the GLB."""
    return [rounded(vector[0]), rounded(vector[2]), rounded(-vector[1])]


def rounded(value: float) -> float:
    """Seven digits: the precision of Blender's own numbers."""
    return float(f"{value:.7g}") + 0.0


def moving(frames: Sequence[dict[str, list[float]]]) -> list[str]:
    """Names of the things that are not at the same place in all frames, or not there at all.

    Args:
        frames: name -> coordinates of the corners of a box around the thing.
    """
    first = frames[0]
    return [
        name
        for name in dict.fromkeys(name for places in frames for name in places)
        if any(
            name not in places
            or name not in first
            or any(abs(a - b) > STILL for a, b in zip(first[name], places[name], strict=True))
            for places in frames
        )
    ]


def spot_cone(size: float, blend: float) -> tuple[float, float]:
    """Angles `inner` and `outer` of a spot, degrees, of Blender's full angle (radians) and blend (0 to 1).

    Blender's edge is t^2 (3 - 2 t) and glTF's t^2, with t linear in the cosine: both let the same light through if the
    inner cosine lies at 3/4 of the way.
    """
    outer = min(max(size / 2, math.radians(NARROWEST)), math.radians(FLATTEST))
    edge = (1 - math.cos(outer)) * blend
    return math.degrees(math.acos(min(math.cos(outer) + 0.75 * edge, 1.0))), math.degrees(outer)


def light_row(data: Any, matrix: Any, factor: Sequence[float]) -> tuple[str, Row]:
    """Kind of source and key of a light; strengths as Cycles has them.

    Args:
        data: bpy.types.Light.
        matrix: its place in the world.
        factor: (3,) of what its nodes and temperature say.
    """
    way = y_up(-matrix.col[2].xyz.normalized())
    power = [data.energy * 2.0**data.exposure * color * f for color, f in zip(data.color, factor, strict=True)]
    row: Row = {"position": y_up(matrix.translation), "direction": way}
    if data.type == "SUN":
        if not data.normalize:
            power = [p * math.pi * math.sin(data.angle / 2) ** 2 for p in power]
        row = {"direction": way, "irradiance": numbers(power)}
        return "directional", row | ({"angle": rounded(math.degrees(data.angle))} if data.angle > 0 else {})
    if data.type == "AREA":
        x, y = (data.size * matrix.col[0].xyz.length, _other_side(data) * matrix.col[1].xyz.length)
        round_one = data.shape in ("DISK", "ELLIPSE")
        area = x * y * (math.pi / 4 if round_one else 1.0)
        row["power"] = numbers([p if data.normalize else p * area for p in power])
        if round_one:
            return "disc", row | {"radius": rounded(math.sqrt(x * y) / 2)}
        return "rect", row | {"width": rounded(x), "height": rounded(y), "up": y_up(matrix.col[1].xyz.normalized())}
    radius = data.shadow_soft_size
    spread = 4 * math.pi if data.normalize or radius == 0 else 1 / radius**2
    row |= {"intensity": numbers([p / spread for p in power])} | ({"radius": rounded(radius)} if radius > 0 else {})
    if data.type == "POINT":
        del row["direction"]
        return "point", row
    inner, outer = spot_cone(data.spot_size, data.spot_blend)
    return "spot", row | {"inner": rounded(inner), "outer": rounded(outer)}


def _other_side(data: Any) -> float:
    return float(data.size_y if data.shape in ("RECTANGLE", "ELLIPSE") else data.size)


def numbers(values: Sequence[float]) -> list[float]:
    """Strengths, none of them negative."""
    return [max(rounded(value), 0.0) for value in values]


def lens_row(data: Any, scene: Any, size: Sequence[int]) -> Row:
    """The keys of a camera's lens: field of view or height, and lens shift; none of a panorama.

    Args:
        data: bpy.types.Camera.
        size: width and height, pixels.
    """
    if data.type == "PANO":
        return {}
    corners = data.view_frame(scene=scene)  # right and left, top and bottom, at one distance
    wide, tall = corners[0].x - corners[3].x, corners[0].y - corners[1].y
    middle = [(corners[0].x + corners[2].x) / 2, (corners[0].y + corners[2].y) / 2]
    sides = [middle[k] / extent * size[k] / max(size) for k, extent in enumerate((wide, tall))]
    shift = [float(f"{value:.6f}") + 0.0 for value in sides]
    if data.type == "ORTHO":
        return {"height": rounded(tall), "shift": shift}
    return {"fov": rounded(math.degrees(2 * math.atan2(tall / 2, -corners[0].z))), "shift": shift}


def common_keys(rows: Sequence[Row], names: Sequence[str]) -> tuple[Row, list[Row]]:
    """Take out of rows what all of them have in common: that, and the rest of each."""
    same = {key: rows[0][key] for key in names if key in rows[0] and all(row[key] == rows[0][key] for row in rows)}
    return same, [{name: value for name, value in row.items() if name not in same} for row in rows]


def keys_of(rows: Sequence[Row]) -> list[Row]:
    """A key per frame; one key for what stands still."""
    still = all(row == rows[0] for row in rows)
    return [{"frame": frame, **row} for frame, row in enumerate(rows[:1] if still else rows)]


def toml(table: Row, name: str = "") -> Iterator[str]:
    """Lines of a table: its values, then its tables, and lists of tables whose keys stand in one line each."""
    nested = {key: value for key, value in table.items() if isinstance(value, dict)}
    lists = {key: value for key, value in table.items() if key == "sources"}
    for key, value in table.items():
        if key not in nested and key not in lists and not key.startswith("#"):
            yield f"{key} = {inline(value, wide=key == 'keys')}"
        yield from (f"# {line}" for line in value) if key.startswith("#") else ()
    for key, value in nested.items():
        yield from ("", f"[{name}{key}]", *toml(value, f"{name}{key}."))
    for key, value in lists.items():
        for source in value:
            yield from ("", f"[[{name}{key}]]", *toml(source))


def inline(value: Any, *, wide: bool = False) -> str:
    """Write a value as TOML."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {inline(entry)}" for key, entry in value.items()) + " }"
    if isinstance(value, list):
        entries = [inline(entry) for entry in value]
        return "[\n" + "".join(f"  {entry},\n" for entry in entries) + "]" if wide else f"[{', '.join(entries)}]"
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


class Export:
    """One scene of Blender on its way into a job."""

    def __init__(self, options: argparse.Namespace) -> None:
        """Take over the scene that is open."""
        import bpy

        self.bpy, self.options = bpy, options
        self.scene = bpy.context.scene
        self.notes: list[str] = []

    def write(self, job: Path) -> None:
        """Write the job, its GLB and its panorama, beside one another."""
        scene, glb = self.scene, job.with_suffix(".glb")
        if scene.camera is None:
            raise SystemExit(f"{self.bpy.data.filepath or 'the scene'}: expected a camera, got none; add one")
        camera, lights = self.camera(), self.lights()
        if names := moving([self.places(graph) for graph in self.at_frames(min(self.frames, LOOKS))]):
            more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
            self.note(f"what moves or changes stands as at the first frame: {', '.join(names[:MOST_NAMES])}{more}")
        scene.frame_set(scene.frame_start)
        size = self.write_glb(glb)
        shining = self.shining(glb)
        sources, background = self.world(job, needed=not lights and not shining)
        sources += lights + shining
        if not sources:
            raise SystemExit("expected a light, a world with a picture or a material that shines, got none; add one")
        n = max(len(source["keys"]) for source in sources)
        table: Row = {
            "# about": [f"Written by {Path(__file__).name} from {Path(self.bpy.data.filepath).name or 'a scene'}."]
            + [f"note: {note}" for note in self.notes],
            "name": "".join(c if c.isascii() and c.isalnum() else "-" for c in job.stem).strip("-") or "scene",
            "scene": {"file": glb.name, "up": "y", "surfaces": "file", "background": background},
            "camera": camera,
            "light": {"frames": n, "sources": sources},
            "samples": {"hits": 2, "obscurance": 5},
            "reuse": {"n_r": 3, "weights": "area"},
            "obscurance": {"range": float(f"{RANGE_SHARE * size:.2g}"), "outside": "background"},
            "indirect": {"method": "cells"},
            "output": {
                "directory": f"out/{job.stem}",
                "format": self.options.format,
                "fps": rounded(scene.render.fps / scene.render.fps_base),
                "exposure": rounded(scene.view_settings.exposure),
            },
        }
        job.write_text("\n".join(toml(table)) + "\n", encoding="utf-8")
        print(*(f"note: {note}\n" for note in self.notes), sep="", end="")
        print(f"{job}: camera positions: {camera['frames']}, light positions: {n}; next: framearray render {job}")

    def at_frames(self, wanted: int) -> Iterator[Any]:
        """Go to a number of frames, evenly from the first to the last."""
        first, last = self.scene.frame_start, self.scene.frame_end
        for k in range(wanted):
            frame = first + (last - first) * k / max(wanted - 1, 1)
            self.scene.frame_set(int(frame // 1), subframe=frame % 1)
            yield self.bpy.context.evaluated_depsgraph_get()

    @property
    def frames(self) -> int:
        """The number of frames of the scene, by its step."""
        return int((self.scene.frame_end - self.scene.frame_start) // self.scene.frame_step + 1)

    def camera(self) -> Row:
        """The table of the camera; a new one may be bound to every frame."""
        render, rows = self.scene.render, []
        kinds: dict[str, str] = {}  # type of camera -> name of the first one
        size = [round(side * render.resolution_percentage / 100) for side in (render.resolution_x, render.resolution_y)]
        n = self.options.frames or self.frames
        for graph in self.at_frames(n):
            camera = self.scene.camera.evaluated_get(graph)
            kinds.setdefault(self.camera_type(camera, size), camera.name)
            matrix = camera.matrix_world
            rows.append(
                {
                    "eye": y_up(matrix.translation),
                    "target": y_up(matrix.translation - AHEAD * matrix.col[2].xyz.normalized()),
                    "up": y_up(matrix.col[1].xyz.normalized()),
                    **lens_row(camera.data, self.scene, size),
                }
            )
            if camera.data.type == "PANO" and (camera.data.shift_x or camera.data.shift_y):
                self.note("the lens shift of a panorama is left out", camera.name)
            if camera.data.dof.use_dof:
                self.note("depth of field is left out")
        if len(kinds) > 1:
            found = " and ".join(f"{name} ({kind})" for kind, name in kinds.items())
            raise SystemExit(f"expected cameras of one type at all frames, got {found}; export each by its own frames")
        if render.use_motion_blur:
            self.note("motion blur is left out")
        (kind,) = kinds
        lens, rows = common_keys(rows, ("fov", "height", "shift"))
        lens = {key: value for key, value in lens.items() if value != [0.0, 0.0]}
        aspect = rounded(render.pixel_aspect_x / render.pixel_aspect_y)
        stretched = {} if aspect == 1 or kind == "panorama" else {"pixel_aspect": aspect}
        keys = keys_of(rows)
        return {
            **({} if kind == "perspective" else {"type": kind}),
            "resolution": size,
            **lens,
            **stretched,
            "frames": n if len(keys) > 1 or self.options.frames else 1,
            "keys": keys,
        }

    def camera_type(self, camera: Any, size: Sequence[int]) -> str:
        """The type of a camera as a job has it; others end the export with a message."""
        if camera.data.type != "PANO":
            return {"PERSP": "perspective", "ORTHO": "orthographic"}[camera.data.type]
        owner = camera.data if hasattr(camera.data, "panorama_type") else camera.data.cycles  # before Blender 5
        if owner.panorama_type != "EQUIRECTANGULAR":
            problem = f"expected a panorama of type EQUIRECTANGULAR, got {owner.panorama_type}; change it"
            raise SystemExit(f"{camera.name}: {problem}")
        ends = (owner.longitude_min, owner.longitude_max, owner.latitude_min, owner.latitude_max)
        whole = (-math.pi, math.pi, -math.pi / 2, math.pi / 2)
        if size[0] != 2 * size[1] or any(abs(end - full) > 1e-4 for end, full in zip(ends, whole, strict=True)):
            problem = (
                f"expected a panorama of 360 x 180 degrees, twice as wide as high, got {size[0]} x {size[1]} pixels"
            )
            raise SystemExit(f"{camera.name}: {problem}; set the resolution, longitude and latitude")
        return "panorama"

    def note(self, text: str, name: str = "") -> None:
        """Note what is left out, once."""
        line = f"{name}: {text}" if name else text
        if line not in self.notes:
            self.notes.append(line)

    def lights(self) -> list[Row]:
        """The sources of all lights; at several positions if any of them moves or changes."""
        paths = self.light_paths(self.frames)
        moving = any(any(row != rows[0] for row in rows) for _, rows in paths.values())
        if moving and self.frames > (wanted := self.options.lights or MOST_LIGHTS):
            paths = self.light_paths(wanted)
        sources: list[Row] = []
        for name, (kind, rows) in paths.items():
            group = "".join(c if c.isascii() and c.isalnum() else "-" for c in name).strip("-")[:24] or "light"
            taken = [source.get("group") for source in sources]
            group = group if group not in taken else f"{group}-{len(sources)}"
            named = {"group": group} if self.options.groups else {}
            sources.append({"# about": [name], "type": kind, **named, "keys": keys_of(rows)})
        return sources

    def light_paths(self, n: int) -> dict[str, tuple[str, list[Row]]]:
        """Name -> kind and rows at n frames of every light that renders; dark where it does not."""
        found: dict[str, tuple[str, list[Row]]] = {}
        for k, graph in enumerate(self.at_frames(n)):
            shining = set()
            for instance in graph.object_instances:
                lamp = instance.object
                if lamp.type != "LIGHT" or lamp.hide_render or lamp.name_full in self.hidden or not instance.show_self:
                    continue
                name = "-".join(
                    [lamp.name, *(str(i) for i in instance.persistent_id if instance.is_instance and i < 2**31 - 1)]
                )
                kind, row = light_row(lamp.data, instance.matrix_world, self.factor(lamp))
                rows = found.setdefault(name, (kind, [dark(row)] * k))[1]
                rows.append(row)
                shining.add(name)
            for name in found.keys() - shining:
                found[name][1].append(dark(found[name][1][-1]))
        return found

    @property
    def hidden(self) -> set[str]:
        """Names of the objects that only stand in collections that do not render."""
        shown, waiting = set(), [self.scene.collection]
        while waiting:
            collection = waiting.pop()
            if not collection.hide_render:
                shown |= {thing.name_full for thing in collection.objects}
                waiting += list(collection.children)
        return {thing.name_full for thing in self.scene.objects} - shown

    def factor(self, lamp: Any) -> list[float]:
        """(3,) what temperature and nodes of a light multiply its strength with; also note what is left out."""
        data = lamp.data
        factor = list(data.temperature_color) if data.use_temperature else [1.0, 1.0, 1.0]
        if data.use_nodes and data.node_tree:
            emission = surface_node(data.node_tree)
            if emission is None or emission.type != "EMISSION" or any(socket.is_linked for socket in emission.inputs):
                self.note("the nodes of the light are left out", lamp.name)
            else:
                color, strength = (emission.inputs[key].default_value for key in ("Color", "Strength"))
                factor = [f * c * strength for f, c in zip(factor, color, strict=False)]
        if data.type == "AREA" and data.spread < math.pi - 1e-3:
            self.note("the spread of the area light is left out", lamp.name)
        if data.type == "AREA" and data.shape == "ELLIPSE":
            self.note("the ellipse is a disc of its area", lamp.name)
        if not data.use_shadow:
            self.note("the light throws shadows all the same", lamp.name)
        return factor

    def places(self, graph: Any) -> dict[str, list[float]]:
        """Name -> corners of a box around each surface that renders, with its modifiers."""
        found = {}
        for thing in self.scene.objects:
            if thing.type in SURFACES and not thing.hide_render:
                posed = thing.evaluated_get(graph)
                corners = (posed.matrix_world @ self.vector(corner) for corner in posed.bound_box)
                found[thing.name] = [float(value) for corner in corners for value in corner]
        return found

    def write_glb(self, glb: Path) -> float:
        """Write all that renders, as it is at the current frame; return its largest extent."""
        self.bpy.ops.export_scene.gltf(
            filepath=str(glb.resolve()),
            export_format="GLB",
            use_renderable=True,
            use_active_scene=True,
            export_apply=True,
            export_animations=False,
            export_cameras=False,
            export_lights=False,
        )
        corners = [
            thing.matrix_world @ self.vector(corner)
            for thing in self.scene.objects
            if thing.type in SURFACES and not thing.hide_render
            for corner in thing.bound_box
        ]
        if not corners:
            raise SystemExit("expected surfaces that render, got none")
        return float(max(max(c[k] for c in corners) - min(c[k] for c in corners) for k in range(3)))

    def vector(self, values: Any) -> Any:
        """A vector of Blender."""
        from mathutils import Vector

        return Vector(values)

    def world(self, job: Path, *, needed: bool) -> tuple[list[Row], list[float]]:
        """Source of the world and background of the scene: a constant colour needs no source beside others."""
        world = self.scene.world
        if world is None:
            return [], [0.0, 0.0, 0.0]
        node = surface_node(world.node_tree) if world.node_tree else None
        if node is None and not world.node_tree:
            return [], numbers(world.color)
        if node is None:
            return [], [0.0, 0.0, 0.0]
        if node.type == "BACKGROUND" and not any(socket.is_linked for socket in node.inputs):
            color, strength = (node.inputs[key].default_value for key in ("Color", "Strength"))
            if not needed or not max(color[:3]) * strength > 0:
                return [], numbers([c * strength for c in color[:3]])
        panorama = job.with_name(f"{job.stem}-world.exr")
        self.render_world(world, panorama)
        keys = [{"frame": 0, "rotation": 0}]
        group = {"group": "world"} if self.options.groups else {}
        return [{"type": "environment", **group, "file": panorama.name, "keys": keys}], [0.0, 0.0, 0.0]

    def render_world(self, world: Any, file: Path) -> None:
        """Render the world as a panorama, whatever nodes it has; -z of the GLB is in its middle."""
        bpy = self.bpy
        scene = bpy.data.scenes.new("framearray world")
        camera = bpy.data.objects.new("framearray world", bpy.data.cameras.new("framearray world"))
        scene.collection.objects.link(camera)
        camera.data.type, camera.data.panorama_type = "PANO", "EQUIRECTANGULAR"
        camera.rotation_euler = (math.pi / 2, 0.0, 0.0)
        scene.world, scene.camera, scene.render.engine = world, camera, "CYCLES"
        scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.pixel_filter_type = 16, False, "BOX"
        render, picture = scene.render, scene.render.image_settings
        render.resolution_x, render.resolution_y = 2 * self.options.panorama, self.options.panorama
        picture.file_format, picture.color_depth, render.filepath = "OPEN_EXR", "32", str(file.resolve())
        bpy.ops.render.render(scene=scene.name, write_still=True)
        bpy.data.scenes.remove(scene)
        self.clip(file)

    def clip(self, file: Path) -> None:
        """Take what is below 0 out of a panorama: colours of nodes may be negative, light may not."""
        import numpy as np

        image = self.bpy.data.images.load(str(file.resolve()))
        pixels = np.empty(len(image.pixels), np.float32)
        image.pixels.foreach_get(pixels)
        if (pixels < 0).any():
            image.pixels.foreach_set(np.maximum(pixels, 0))
            image.save()
            self.note("colours of the world below 0 are black")

    def shining(self, glb: Path) -> list[Row]:
        """Sources of the materials that shine, the strongest ones; by what the exporter wrote of them."""
        data = glb.read_bytes()
        tree = json.loads(data[20 : 20 + struct.unpack_from("<I", data, 12)[0]])
        found = []
        for entry in tree.get("materials", []):
            strength = (
                entry.get("extensions", {}).get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1.0)
            )
            if (power := max(entry.get("emissiveFactor", [0.0])) * strength) > 0:
                found.append((power, entry))
        found.sort(key=lambda one: -one[0])
        if len(found) > MOST_SHINING:
            self.note(f"materials that are fainter light nothing, and are seen: {len(found) - MOST_SHINING}")
        key = [{"frame": 0, "intensity": 1.0}]
        return [
            {"type": "mesh", "material": entry["name"], "two_sided": entry.get("doubleSided", False), "keys": key}
            for _, entry in found[:MOST_SHINING]
        ]


def dark(row: Row) -> Row:
    """A row whose light is out."""
    return row | {key: [0.0, 0.0, 0.0] for key in ("power", "intensity", "irradiance") if key in row}


def surface_node(tree: Any) -> Any:
    """The node that the output of a node tree shows; None without one."""
    outputs = [node for node in tree.nodes if node.type.startswith("OUTPUT_") and node.is_active_output]
    links = outputs[0].inputs["Surface"].links if outputs else ()
    return links[0].from_node if links else None


def read_options(arguments: Sequence[str]) -> argparse.Namespace:
    """Read the command line behind `--`."""
    parser = argparse.ArgumentParser(prog="framearray_export.py", description="Write a GLB and a job of framearray.")
    parser.add_argument("job", type=Path, metavar="JOB.toml", help="the job; GLB and panorama get its name")
    parser.add_argument("--blend", type=Path, help="the file to open, where Blender has not opened it")
    parser.add_argument("--frames", type=int, metavar="N", help="camera positions; default: every frame of the scene")
    parser.add_argument(
        "--lights", type=int, metavar="N", help=f"light positions of what moves; default: at most {MOST_LIGHTS}"
    )
    parser.add_argument("--groups", action="store_true", help="store the light of every lamp separately")
    parser.add_argument("--format", choices=("png", "exr", "tif", "jpg"), default="png", help="of the images")
    parser.add_argument("--panorama", type=int, default=512, metavar="N", help="rows of the world's panorama")
    return parser.parse_args(list(arguments))


def main() -> None:
    """Write the scene that Blender has open."""
    inside = "--" in sys.argv  # Blender keeps its own arguments before
    options = read_options(sys.argv[sys.argv.index("--") + 1 :] if inside else sys.argv[1:])
    if options.blend is not None:
        import bpy

        bpy.ops.wm.open_mainfile(filepath=str(options.blend))
    Export(options).write(options.job)


if __name__ == "__main__":
    main()
