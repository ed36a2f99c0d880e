"""Tables of AOVs, which layers keep of each hit: object and material, position, texture coordinates."""

from dataclasses import dataclass

import numpy as np

from framearray_cli.base.arrays import CornerUvs, Float64, Int32
from framearray_cli.scene.panes import G
from framearray_cli.scene.scene import Scene

# Columns of a hit's AOVs: the number of its pair of object and material, -1 of a ray that escaped; its position,
# centred; its texture coordinates.
PAIR, POSITION, UV = 0, 1, 4
# Columns of what is in front of a hit: the pair of the pane, -1 for none, and the share of the hit that it covers.
PANE, COVERED = 0, 1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AovTables:
    """The tables that AOVs of hits are read from.

    Attributes:
        columns: of AOVs: up to POSITION, UV or the end.
        pair: (n,) the pair of object and material of every triangle.
        panes: (n_panes, 2) the pair of each pane, and 1 if the pane is glass, which hides everything behind it in
            mattes; other panes cover a part.
        names: by kind, the names of objects and of materials, each once.
        number: by kind, (n_pairs,) index of a pair's name.
        uvs: (n, 3, 2) of `Scene`.
        centre: (3,) of the scene, from `Scene.position_origin`.
        mattes, position, uv: which layers are wanted.
    """

    columns: int
    pair: Int32
    panes: Int32
    names: tuple[tuple[str, ...], tuple[str, ...]]
    number: tuple[Int32, Int32]
    uvs: CornerUvs
    centre: Float64
    mattes: bool
    position: bool
    uv: bool

    @property
    def places(self) -> int:
        """Number of channels of position and texture coordinates: 0, 3 or 5."""
        return self.columns - POSITION


def aov_columns(*, mattes: bool, position: bool, uv: bool) -> int:
    """Return the number of columns that layers need; 0 for none."""
    return UV + 2 if uv else UV if position else POSITION if mattes else 0


def aov_tables(scene: Scene, *, mattes: bool, position: bool, uv: bool) -> AovTables | None:
    """Return the tables for the layers that a job wants; None for none."""
    columns = aov_columns(mattes=mattes, position=position, uv=uv)
    if not columns:
        return None
    materials, material = _by_name(scene.material_names)
    objects = np.concatenate([scene.object, scene.pane_object]).astype(np.int64)
    both = objects * len(materials) + material[np.concatenate([scene.material, scene.pane_material])]
    pairs, number = np.unique(both, return_inverse=True)
    pair: Int32 = number.reshape(-1).astype(np.int32)
    n = len(scene.object)
    return AovTables(
        columns=columns,
        pair=pair[:n],
        panes=np.stack([pair[n:], scene.pane_optics[:, G] > 0], axis=1).astype(np.int32),
        names=(scene.object_names, materials),
        number=((pairs // len(materials)).astype(np.int32), (pairs % len(materials)).astype(np.int32)),
        uvs=scene.uvs[: len(scene.corners)],
        centre=scene.centre - scene.position_origin if position else scene.centre,
        mattes=mattes,
        position=position,
        uv=uv,
    )


def _by_name(names: tuple[str, ...]) -> tuple[tuple[str, ...], Int32]:
    """Return each name once, and the index of every name among these."""
    found: dict[str, int] = {}
    numbers = np.array([found.setdefault(name, len(found)) for name in names], np.int32)
    return tuple(found), numbers
