"""What a good first picture shows: hand-made labels for models, for the scenes of jobs/ and for scenes of other people.

Shares are of the picture; a name stands for all materials that begin with it, several names are joined by "|".
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from support import ROOT
from support.models import rooms, things
from support.models.shapes import Model
from support.scenes import scenes_folder

Shares = Mapping[str, float]


@dataclass(frozen=True, kw_only=True)
class Case:
    """A scene and its labels.

    Attributes:
        build: makes the model; None for the file `file`.
        unit, up: of the file; the labels below are in metres.
        inside: whether it counts as a room.
        shows: least shares of the picture, that make it a picture of this scene.
        little: largest shares, of bare surfaces.
        eye: least and largest height of the eye above what is below it, metres; None: any.
        whole: what lies within every picture, with a margin; "" for everything, None for nothing.
    """

    name: str
    build: Callable[[], Model] | None = None
    suffix: str = ".glb"
    file: Path | None = None
    unit: str = "m"
    up: str = "y"
    inside: bool = False
    shows: Shares
    little: Shares = field(default_factory=dict)
    eye: tuple[float, float] | None = None
    whole: str | None = None

    def scene(self, folder: Path) -> Path:
        """The file of the scene; models are written to a folder."""
        if self.build is None:
            assert self.file is not None
            return self.file
        return self.build().save(folder / f"{self.name}{self.suffix}", self.unit, self.up)


STANDING = (1.1, 1.9)  # metres; where people hold a camera
DINING = Case(
    name="dining-m",
    build=rooms.dining_room,
    inside=True,
    shows={"Table": 0.02, "Chair": 0.03, "Painting|WindowFrame": 0.008, "Wall": 0.1},
    little={"Wall|Ceiling": 0.72},
    eye=STANDING,
)
MUG = Case(name="mug", build=things.mug, shows={"Glaze": 0.15}, whole="")
MODELS = (
    DINING,
    replace(DINING, name="dining-cm", suffix=".obj", unit="cm"),
    replace(DINING, name="dining-mm", suffix=".stl", unit="mm", up="z"),
    replace(DINING, name="dining-inch", unit="in"),
    replace(DINING, name="dining-feet", suffix=".obj", unit="ft"),
    replace(DINING, name="dining-z-up", suffix=".obj", up="z"),
    Case(
        name="bare-room",
        build=rooms.bare_room,
        inside=True,
        shows={"Floor": 0.08, "Wall": 0.2, "": 0.7},
        little={"Wall": 0.75},
        eye=STANDING,
    ),
    Case(
        name="street",
        build=rooms.street,
        shows={"House": 0.15, "Ground|Pavement": 0.1, "Trunk|Crown|Car": 0.02},
        little={"Ground": 0.5},
        eye=(1.1, 6.0),
    ),
    MUG,
    replace(MUG, name="mug-mm", suffix=".stl", unit="mm", up="z", shows={"": 0.15}),
    Case(name="bottle", build=things.bottle, shows={"Clay": 0.05, "Label": 0.02}, whole=""),
    Case(name="car", build=things.car, shows={"Body": 0.1, "Wheel": 0.02, "Seat|Pillar": 0.01}, whole=""),
    Case(
        name="table-scene",
        build=things.table_scene,
        shows={"Table": 0.06, "Bowl": 0.008, "Books": 0.006, "Bottle": 0.003},
        whole="Table|Bowl|Books|Bottle",
    ),
)


def _of_file(file: Path, *, inside: bool = True, **labels: Any) -> Case:
    """A room in a file, unless `inside` says otherwise."""
    return Case(name=file.stem, file=file, inside=inside, **labels)


OWN = (
    _of_file(
        ROOT / "jobs" / "scenes" / "kitchen.glb",
        shows={"TableTop|Dresser|Cabinet|Worktop": 0.05, "WindowPaint|Porcelain|Gingham|Enamel": 0.01},
        little={"WallPaint|Ceiling|Plaster": 0.7},
        eye=STANDING,
    ),
    _of_file(
        ROOT / "jobs" / "scenes" / "stairs.glb",
        shows={"Runner|RailWood|Marble|FloorMarble": 0.08, "WindowPaint|Crystal|Gilding|Velvet": 0.005},
        little={"WallSilk|Plaster|Ceiling": 0.7},
        eye=(1.0, 7.0),
    ),
    _of_file(
        ROOT / "jobs" / "scenes" / "cabin.glb",
        shows={"Seat": 0.08, "Bin|Ceiling|Cove": 0.05, "Panel|WindowRim|Blind|Carpet|AisleCarpet": 0.03},
        little={"SeatShell": 0.5, "Ceiling": 0.6},
    ),
)
OTHERS = (
    _of_file(
        scenes_folder() / "cornell_box" / "cornell_box.obj",
        shows={"shortBox": 0.03, "tallBox": 0.03, "leftWall": 0.03, "rightWall": 0.03, "floor": 0.05},
    ),
    _of_file(
        scenes_folder() / "country_kitchen" / "country_kitchen.glb",
        shows={"Tabletop|Worktops|SmallWorktop": 0.01, "CupboardUnits": 0.03, "Window|Cooker|Blinds|Kettle": 0.01},
        little={"Walls|Ceiling": 0.7},
        eye=STANDING,
    ),
    _of_file(
        scenes_folder() / "grey_white_room" / "grey_white_room.glb",
        shows={"Sofa": 0.03, "TableWood": 0.01, "Floor": 0.05},
        little={"Walls|MattePaint": 0.7},
        eye=STANDING,
    ),
    _of_file(
        scenes_folder() / "iss_kibo_cabin" / "iss_kibo_cabin.glb",
        shows={"JPM_Racks": 0.2, "JPM_Bulkhead|Generic_Hub": 0.03},
    ),
    _of_file(
        scenes_folder() / "modern_hall" / "modern_hall.glb",
        shows={"Wood": 0.03, "FloorTiles": 0.05},
        little={"Wall|Wallpaper": 0.75},
        eye=(1.0, 4.5),
    ),
    _of_file(scenes_folder() / "utah_teapot" / "utah_teapot.stl", inside=False, shows={"": 0.15}, whole="", up="z"),
    _of_file(scenes_folder() / "vr_gallery" / "vr_gallery.glb", shows={"": 0.5}, eye=STANDING),
)
