"""IFC through IfcOpenShell: elements -> parts, styles -> materials, spaces -> places, the site -> a place on Earth.

IfcOpenShell makes triangles of all shapes, in metres, with openings cut out, in the coordinates of the project: z up.
"""

import math
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.base.colour import linear_from_srgb
from framearray_cli.base.errors import SceneError
from framearray_cli.base.extras import install_command

from .assets import Assets
from .geometry import Mesh
from .materials import BLACK, MaterialSource, MeshBuilder
from .model import GREY, Material, Meshes, Notes, PaneGlass, rgb3
from .staging import EarthPlace, Stage, StageRoom

SUFFIXES = ("ifc", "ifczip")
UNSEEN = ("IfcOpeningElement", "IfcSpace")
LIBRARY = "hybrid-cgal-simple-opencascade"  # of geometry; "opencascade" takes twice the time
MOST_WHOLES = 64  # that an element is a part of; a broken file may have circles
LEAST_STOREY = 0.5  # metres to the next storey; a level of a ceiling or a screed is nearer
GLAZED = ("IfcWindow", "IfcPlate")  # glass, if they have no style
IFC_HEAD = re.compile(rb"PK|(?:(?!FILE_SCHEMA).)*FILE_SCHEMA\s*\(\s*\(\s*'\w+'", re.IGNORECASE | re.DOTALL)  # or ZIP
LONGEST_HEAD = 1 << 20  # bytes; exporters may write comments
CLEAR = 0.85  # transparency of such glass


def read_ifc(file: Path, assets: Assets) -> Meshes:
    """Read the elements of an IFC file.

    Raises:
        SceneError: IfcOpenShell is missing, or cannot read the file.
    """
    model, found = _opened(file), MeshBuilder(assets=assets)
    numbers: dict[Any, int] = {}
    for shape in _shapes(model, exclude=UNSEEN):
        element, mesh = model.by_id(shape.id), shape.geometry
        vertices = np.array(mesh.verts, np.float64).reshape(-1, 3)
        faces, ids = np.array(mesh.faces, np.int64).reshape(-1, 3), np.array(mesh.material_ids, np.int64)
        name = (_object_name(element),)
        for number in np.unique(ids):
            style = mesh.materials[number] if number >= 0 else None
            key = (style.instance_id(), style.name) if style else None
            if key not in numbers:
                numbers[key] = found.add_material(_material(model, style, found))
            placed = Mesh(material=numbers[key], vertices=vertices, faces=faces[ids == number])
            found.place(placed, np.eye(4)[None], name)
    return found.meshes()


def read_ifc_stage(file: Path) -> Stage:
    """Read where the site of an IFC file is, and its rooms and storeys.

    Raises:
        SceneError: as `read_ifc`.
    """
    model, rooms, notes = _opened(file), dict[str, Float64](), Notes()
    for shape in _shapes(model, include=("IfcSpace",)):
        space, points = model.by_id(shape.id), np.array(shape.geometry.verts, np.float64).reshape(-1, 3)
        if len(points):
            box = np.array([points.min(axis=0), points.max(axis=0)])
            storey, name = "/".join(_whereabouts(space)[:1]), _name(space)
            rooms[f"{name}, {storey}" if name in rooms else name] = box
            other = rooms.get(storey, box)
            rooms[storey] = np.array([np.minimum(box[0], other[0]), np.maximum(box[1], other[1])])
    named = sorted((dict(_storeys(model)) | rooms).items())
    places = tuple(StageRoom(name=name, box=box) for name, box in named if name)
    return Stage(up="z", metres=1.0, rooms=places, earth=_earth_place(model, notes), notes=notes.lines())


def _opened(file: Path) -> Any:
    try:
        import ifcopenshell
        import ifcopenshell.geom
    except ImportError as error:
        remedy = f"export the scene as GLB, or install it with: {install_command('[ifc]')}"
        raise SceneError(f"reading IFC files needs IfcOpenShell; {remedy}") from error
    # IfcOpenShell ends the process on a schema without quotes, and on an element whose number is another's, too.
    with file.open("rb") as opened:
        if not IFC_HEAD.match(opened.read(LONGEST_HEAD)):
            raise SceneError("broken, or not IFC (no FILE_SCHEMA); export it anew")
    model = ifcopenshell.open(str(file))
    for element in model.by_type("IfcProduct"):
        if model.by_id(element.id()) != element:
            raise SceneError(f"broken IFC: #{element.id()} is two entities; export it anew")
    return model


def _shapes(model: Any, **chosen: Any) -> Iterator[Any]:
    """Yield the triangles of chosen kinds of elements, in the order of the file."""
    import ifcopenshell.geom

    geometry: Any = ifcopenshell.geom
    settings = geometry.settings()
    for name in ("use-world-coords", "no-normals"):
        settings.set(name, True)
    if "include" in chosen and not any(model.by_type(kind) for kind in chosen["include"]):
        return
    lists, shapes = {key: list(kinds) for key, kinds in chosen.items()}, list[Any]()
    iterator = geometry.iterator(settings, model, os.cpu_count() or 1, geometry_library=LIBRARY, **lists)
    more = iterator.initialize()
    while more:
        shapes.append(iterator.get())
        more = iterator.next()
    yield from sorted(shapes, key=lambda shape: shape.id)


def _storeys(model: Any) -> Iterator[tuple[str, Float64]]:
    """Name the storeys, with a box of each from its elevation to the next one's, which has no sides."""
    import ifcopenshell.util.placement
    import ifcopenshell.util.unit

    metres = ifcopenshell.util.unit.calculate_unit_scale(model)
    height = ifcopenshell.util.placement.get_storey_elevation
    levels = sorted((float(height(each)) * metres, _name(each)) for each in model.by_type("IfcBuildingStorey"))
    for low, name in reversed(levels):  # of two with one name, the lower counts
        high = min((level for level, _ in levels if level >= low + LEAST_STOREY), default=math.inf)
        yield name, np.array([[-math.inf, -math.inf, low], [math.inf, math.inf, high]])


def _name(place: Any) -> str:
    """The names of a storey or a space, or ""."""
    return " ".join(dict.fromkeys(filter(None, (place.Name, place.LongName))))


def _whereabouts(element: Any) -> list[str]:
    """The names of the storey and the space that an element is in, if there are any."""
    import ifcopenshell.util.element

    find, found = ifcopenshell.util.element, list[str]()
    for _ in range(MOST_WHOLES):
        element = find.get_container(element) or find.get_aggregate(element)
        if element is None or element.is_a() in ("IfcBuilding", "IfcSite"):
            break
        if element.is_a("IfcSpatialStructureElement"):
            found.insert(0, _name(element))
    return [name for name in found if name]


def _object_name(element: Any) -> str:
    """A name for mattes: storey, room and element."""
    own = element.Name or f"{element.is_a().removeprefix('Ifc')} {element.id()}"
    return "/".join([*_whereabouts(element), str(own)])


def _material(model: Any, style: Any, found: MeshBuilder) -> Material:
    """Map a style: its colour, as screens show it, and its transparency."""
    own = style is not None and style.instance_id() > 0
    entity = model.by_id(style.instance_id()) if own else None
    name = getattr(entity, "Name", None) or (style.name if style else "no style")
    source = MaterialSource(name=str(name).removeprefix("Ifc"), assets=found.assets, textures=found.textures)
    colour = np.full(3, GREY)
    transparency = 0.0
    if style is not None:
        channels = np.array([style.diffuse.r(), style.diffuse.g(), style.diffuse.b()], np.float64)
        colour = linear_from_srgb(np.clip(np.nan_to_num(channels, nan=GREY), 0.0, 1.0))
        transparency = float(np.clip(np.nan_to_num(style.transparency, nan=0.0), 0.0, 1.0))
        if not own and style.name in GLAZED:
            source.note("windows and plates without a style are taken as glass")
            transparency = CLEAR
    glass = PaneGlass(colour=(transparency,) * 3) if found.assets.as_file else None
    opacity = source.blended(1.0 - transparency, -1, glass)
    return source.make(opacity, (rgb3(colour), BLACK))


def _earth_place(model: Any, notes: Notes) -> EarthPlace | None:
    """Latitude and longitude of the site, and the direction of the project that points north."""
    import ifcopenshell.util.geolocation

    site = next((site for site in model.by_type("IfcSite") if site.RefLatitude and site.RefLongitude), None)
    if site is None:
        return None
    try:
        latitude, longitude = (
            float(ifcopenshell.util.geolocation.dms2dd(*angle)) for angle in (site.RefLatitude, site.RefLongitude)
        )
    except (TypeError, ValueError, ZeroDivisionError):
        latitude = longitude = math.nan
    if not (abs(latitude) <= 90 and abs(longitude) <= 180):
        notes.add("the latitude and longitude of the site are no place on Earth and are left out")
        return None
    return EarthPlace(latitude=latitude, longitude=longitude, north=_north(model))


def _north(model: Any) -> tuple[float, float, float]:
    """True north of the project, or else the north of its map; y where the file says neither."""
    for context in model.by_type("IfcGeometricRepresentationContext", include_subtypes=False):
        if context.TrueNorth is not None:
            x, y = (float(value) for value in context.TrueNorth.DirectionRatios[:2])
            if math.hypot(x, y) > 0:
                return x / math.hypot(x, y), y / math.hypot(x, y), 0.0
    for conversion in model.by_type("IfcMapConversion") if model.schema != "IFC2X3" else ():
        east, north = conversion.XAxisAbscissa or 0.0, conversion.XAxisOrdinate or 0.0  # of the project's x axis
        if math.hypot(east, north) > 0:
            return north / math.hypot(east, north), east / math.hypot(east, north), 0.0
    return 0.0, 1.0, 0.0
