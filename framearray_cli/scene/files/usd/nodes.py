"""Prims of a USD stage -> every place of every mesh: hierarchy, instances, point instancers, visibility and purpose."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.base.errors import SceneError

from ..limit import Limit
from ..model import Notes
from .usdcore import usd

Matrices: TypeAlias = Float64  # (n, 4, 4)
PLACE_BYTES = 1000  # memory per place of a mesh
MOST_LEVELS = 200  # of prims below one another
SHOWN = ("default", "render")  # purposes that pictures show
SURFACES = ("Mesh", "Cube", "Sphere", "Cylinder", "Cone", "Capsule", "Plane", "Cylinder_1", "Capsule_1")
LEFT_OUT = {
    "BasisCurves": "curves are left out",
    "NurbsCurves": "curves are left out",
    "HermiteCurves": "curves are left out",
    "Points": "points are left out",
    "NurbsPatch": "NURBS patches are left out; export polygons",
    "TetMesh": "tetrahedra are left out",
    "Volume": "volumes are left out",
}


@dataclass(slots=True, kw_only=True)
class PlacedMesh:
    """A surface and where it stands.

    Attributes:
        prim: a mesh or another surface; for instances the first one found, whose materials all share.
        places: (n, 4, 4) `world_from_mesh` each.
        paths: of the prims that stand there; all places of an instancer have the path of its prototype.
    """

    prim: Any
    places: list[Matrices] = field(default_factory=list)
    paths: list[str] = field(default_factory=list)

    @property
    def world_from_mesh(self) -> Float64:
        """(n, 4, 4)."""
        return np.concatenate(self.places)

    @property
    def names(self) -> list[str]:
        """The path at each place; only one where all are the same."""
        found = [path for path, places in zip(self.paths, self.places, strict=True) for _ in range(len(places))]
        return found if len(set(self.paths)) > 1 else found[:1]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Visit:
    prim: Any
    places: Float64  # (n, 4, 4) of the parent
    above: tuple[str, ...]  # prototypes on the way down
    level: int = 0


def scene_time(stage: Any) -> Any:
    """The time at which surfaces are read: the first frame of the stage, or of what moves."""
    library = usd()
    if stage.HasAuthoredTimeCodeRange():
        return library.Usd.TimeCode(stage.GetStartTimeCode())
    return library.Usd.TimeCode.EarliestTime()


def placed_meshes(stage: Any, limit: Limit, notes: Notes) -> list[PlacedMesh]:
    """List every surface that pictures of the stage show, with all of its places, in the order of the stage.

    Raises:
        SceneError: an instancer holds itself, or there are more places than memory.
    """
    library = usd()
    time = scene_time(stage)
    found: dict[tuple[str, str], PlacedMesh] = {}
    waiting = [_Visit(prim=stage.GetPseudoRoot(), places=np.eye(4)[None], above=())]
    while waiting:
        visit = waiting.pop()
        prim = visit.prim
        places = visit.places
        if not prim.IsPseudoRoot():
            if not _shows(prim, time):
                continue
            places = _placed(prim, places, time)
            _note(prim, notes)
        if prim.GetTypeName() == "PointInstancer":
            waiting += reversed(list(_instances(prim, places, visit, time, limit, notes)))
            continue
        if prim.GetTypeName() in SURFACES and _is_shown(prim):
            limit.take("places", PLACE_BYTES * len(places))
            placed = found.setdefault(_identity(prim), PlacedMesh(prim=prim))
            placed.places.append(places)
            placed.paths.append(str(prim.GetPath()))
        children = prim.GetFilteredChildren(library.Usd.TraverseInstanceProxies())
        if visit.level >= MOST_LEVELS:
            raise SceneError(f"{prim.GetPath()}: expected at most {MOST_LEVELS} prims below one another")
        waiting += [
            _Visit(prim=child, places=places, above=visit.above, level=visit.level + 1) for child in reversed(children)
        ]
    return list(found.values())


def _identity(prim: Any) -> tuple[str, str]:
    """What tells a surface from others: its place in a prototype, and the material bound from outside, if any."""
    shared = prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim
    material = bound_material(prim)
    return str(shared.GetPath()), str(material.GetPath()) if material else ""


def bound_material(prim: Any) -> Any:
    """The material that a prim is bound to, for previews or for all purposes before that for final pictures."""
    api = usd().UsdShade.MaterialBindingAPI(prim)
    return api.ComputeBoundMaterial("preview")[0] or api.ComputeBoundMaterial("full")[0]


def _shows(prim: Any, time: Any) -> bool:
    """Whether a prim and what is below it may be seen: visibility is inherited, so each step looks at its own."""
    imageable = usd().UsdGeom.Imageable(prim)
    return not imageable or imageable.GetVisibilityAttr().Get(time) != "invisible"


def _is_shown(prim: Any) -> bool:
    return usd().UsdGeom.Imageable(prim).ComputePurpose() in SHOWN


def _placed(prim: Any, places: Float64, time: Any) -> Float64:
    """(n, 4, 4) places of a prim from those of its parent."""
    xformable = usd().UsdGeom.Xformable(prim)
    if not xformable:
        return places
    if xformable.GetResetXformStack():
        places = np.eye(4)[None]
    local = xformable.GetLocalTransformation(time)
    with np.errstate(all="ignore"):  # the scene counts and drops what is not finite
        return np.asarray(places @ matrix(local))


def matrix(gf_matrix: Any) -> Float64:
    """(4, 4) for columns, of a matrix of USD, which is for rows."""
    return np.array(gf_matrix, np.float64).T


def _instances(prim: Any, places: Float64, visit: _Visit, time: Any, limit: Limit, notes: Notes) -> Iterator[_Visit]:
    """Visits of the prototypes of a point instancer, each at all of its instances.

    Raises:
        SceneError: the instancer is below one of its own prototypes.
    """
    library = usd()
    instancer = library.UsdGeom.PointInstancer(prim)
    path = str(prim.GetPath())
    if path in visit.above:
        raise SceneError(f"{path}: the point instancer holds itself: its prototypes have a cycle")
    numbers = np.array(instancer.GetProtoIndicesAttr().Get(time) or [], np.int64)
    targets = instancer.GetPrototypesRel().GetForwardedTargets()
    mask = np.array(instancer.ComputeMaskAtTime(time) or [True] * len(numbers), bool)
    options = (library.UsdGeom.PointInstancer.ExcludeProtoXform, library.UsdGeom.PointInstancer.IgnoreMask)
    limit.take("places", PLACE_BYTES * len(numbers))
    transforms = instancer.ComputeInstanceTransformsAtTime(time, time, *options)
    if transforms is None or len(transforms) != len(numbers) or len(mask) != len(numbers):
        notes.add("point instancers with a wrong number of places are left out", path)
        return
    local = np.array(transforms, np.float64).reshape(-1, 4, 4).transpose(0, 2, 1)
    for k, target in enumerate(targets):
        prototype = prim.GetStage().GetPrimAtPath(target)
        chosen = local[(numbers == k) & mask]
        if prototype and len(chosen):
            limit.take("places", PLACE_BYTES * len(chosen) * len(places))
            at = (places[:, None] @ chosen[None]).reshape(-1, 4, 4)
            yield _Visit(prim=prototype, places=at, above=(*visit.above, path), level=visit.level + 1)


def _note(prim: Any, notes: Notes) -> None:
    """Note what a prim has that pictures do not show."""
    kind = str(prim.GetTypeName())
    if kind in LEFT_OUT:
        notes.add(LEFT_OUT[kind], prim.GetName())
    if kind == "SkelRoot":
        notes.add("skeletons are left out; meshes stand in their rest pose")
    xformable = usd().UsdGeom.Xformable(prim)
    if kind in SURFACES and xformable:
        moves = xformable.TransformMightBeTimeVarying()
        points = prim.GetAttribute("points")
        if moves or (points and points.ValueMightBeTimeVarying()):
            notes.add("meshes that move stand where they are at the first frame", prim.GetName())
