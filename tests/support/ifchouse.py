"""A small IFC house in millimetres, whose north is turned; IfcOpenShell writes it."""

import math
from pathlib import Path
from typing import Any

import pytest

LATITUDE, LONGITUDE = (48, 8, 15, 0), (11, 34, 30, 0)
NORTH_DEG = 30.0  # from the y axis of the project, anticlockwise
BRICK = (0.8, 0.4, 0.2)  # as screens show it
# Rooms and walls: corners of boxes in mm.
HALL = ((200, 200, 0), (4800, 3800, 2500))
WALLS = {
    "south": ((0, 0, 0), (5000, 200, 2500)),
    "north": ((0, 3800, 0), (5000, 4000, 2500)),
    "west": ((0, 200, 0), (200, 3800, 2500)),
    "east low": ((4800, 200, 0), (5000, 3800, 900)),
    "east high": ((4800, 200, 2100), (5000, 3800, 2500)),
    "floor": ((0, 0, -200), (5000, 4000, 0)),
    "roof": ((0, 0, 2500), (5000, 4000, 2700)),
}
PANE = ((4890, 200, 900), (4910, 3800, 2100))


class House:
    """The model while it is written."""

    def __init__(self, schema: str = "IFC4") -> None:
        ifc = pytest.importorskip("ifcopenshell", reason="needs IfcOpenShell: pip install ifcopenshell")
        self.file, self.guid = ifc.file(schema=schema), ifc.guid.new
        make = self.file.create_entity
        units = [make("IfcSIUnit", UnitType="LENGTHUNIT", Prefix="MILLI", Name="METRE")]
        turn = math.radians(NORTH_DEG)
        north = make("IfcDirection", (-math.sin(turn), math.cos(turn)))
        self.context = make(
            "IfcGeometricRepresentationContext",
            ContextType="Model",
            CoordinateSpaceDimension=3,
            WorldCoordinateSystem=self.axes((0.0, 0.0, 0.0)),
            TrueNorth=north,
        )
        project = self.thing(
            "IfcProject",
            "House",
            UnitsInContext=make("IfcUnitAssignment", units),
            RepresentationContexts=[self.context],
        )
        self.site = self.thing("IfcSite", "Plot", RefLatitude=LATITUDE, RefLongitude=LONGITUDE)
        building, self.storey = self.thing("IfcBuilding", "House"), self.thing("IfcBuildingStorey", "Ground")
        for whole, part in ((project, self.site), (self.site, building), (building, self.storey)):
            self.aggregate(whole, part)

    def thing(self, kind: str, name: str, **more: Any) -> Any:
        return self.file.create_entity(kind, GlobalId=self.guid(), Name=name, **more)

    def aggregate(self, whole: Any, part: Any) -> None:
        self.file.create_entity("IfcRelAggregates", GlobalId=self.guid(), RelatingObject=whole, RelatedObjects=[part])

    def axes(self, at: Any) -> Any:
        point = self.file.create_entity("IfcCartesianPoint", tuple(map(float, at)))
        return self.file.create_entity("IfcAxis2Placement3D", point)

    def box(self, kind: str, name: str, corners: Any, style: Any = None, **more: Any) -> Any:
        """An element, or a space, of the shape of a box."""
        make, (low, high) = self.file.create_entity, corners
        x, y, z = (float(b - a) for a, b in zip(low, high, strict=True))
        middle = make("IfcAxis2Placement2D", make("IfcCartesianPoint", (x / 2, y / 2)))
        profile = make("IfcRectangleProfileDef", "AREA", None, middle, x, y)
        solid = make("IfcExtrudedAreaSolid", profile, self.axes(low), make("IfcDirection", (0.0, 0.0, 1.0)), z)
        if style is not None:
            make("IfcStyledItem", solid, [style])
        shape = make("IfcShapeRepresentation", self.context, "Body", "SweptSolid", [solid])
        element = self.thing(
            kind,
            name,
            ObjectPlacement=make("IfcLocalPlacement", None, self.axes((0, 0, 0))),
            Representation=make("IfcProductDefinitionShape", None, None, [shape]),
            **more,
        )
        if kind == "IfcSpace":
            self.aggregate(self.storey, element)
        else:
            relation = {"RelatedElements": [element], "RelatingStructure": self.storey}
            make("IfcRelContainedInSpatialStructure", GlobalId=self.guid(), **relation)
        return element

    def style(self, name: str, colour: Any, transparency: float = 0.0) -> Any:
        make = self.file.create_entity
        rgb = make("IfcColourRgb", None, *colour)
        shading = make("IfcSurfaceStyleRendering", rgb, transparency, ReflectanceMethod="NOTDEFINED")
        return make("IfcSurfaceStyle", name, "BOTH", [shading])


def house(file: Path) -> Path:
    """Write a hall of 4.6 x 3.6 x 2.5 m with a window to the east."""
    made = House()
    brick, glass = made.style("Brick", BRICK), made.style("Pane", (0.7, 0.8, 0.9), 0.81)
    for name, corners in WALLS.items():
        made.box("IfcWall", name, corners, brick)
    made.box("IfcWindow", "window", PANE, glass)
    made.box("IfcSpace", "01", HALL, LongName="Hall")
    made.file.write(str(file))
    return file
