"""Warnings of eyes that see nothing, or only the inside of a solid, and of a camera that passes through walls."""

from collections.abc import Iterator

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.base.lens import ORTHOGRAPHIC, PERSPECTIVE, Lens
from framearray_cli.base.units import agree, digits
from framearray_cli.engine.frames.setup import FrameSetup

from ..prepare import Prepared
from .positions import runs_text
from .rays import BACK, Flags, crossings
from .views import Views

# Share of all pixels looked through that must see a surface; below it the scene is a speck.
SPECK = 0.01
# Share of an eye's pixels that see a surface, from which on it is closed in.
CLOSED = 0.995


def unseen_eyes(views: Views) -> Flags:
    """Return the eyes that see no surface, (E,)."""
    return np.asarray(~views.surface.any(axis=1))


def buried_eyes(views: Views) -> Flags:
    """Return the eyes that see only backs of surfaces, and none that a source lights, (E,)."""
    seen = np.maximum(views.surface.sum(axis=1), 1)
    behind = views.back.sum(axis=1) >= BACK * seen
    shining = bool(views.positions.bright.any())
    unlit = ~views.lit.any(axis=(1, 2))
    return np.asarray(views.reflects.any(axis=1) & behind & unlit & shining)


def eyes_text(flagged: Flags, views: Views, prepared: Prepared) -> str:
    """Name eyes: "cameras 12-31"; all of them without numbers."""
    if prepared.still or prepared.n_cameras == 1:
        return "the camera"
    return "every camera position" if flagged.all() else _cameras(flagged, views)


def _cameras(flagged: Flags, views: Views) -> str:
    return f"{agree(int(flagged.sum()), 'camera', 'cameras')} {runs_text(list(flagged), list(views.eyes))}"


def empty_warnings(views: Views, prepared: Prepared) -> Iterator[str]:
    """Find eyes that see nothing, or a scene that is a speck in the pictures."""
    empty, share = unseen_eyes(views), float(views.surface.mean())
    if empty.any() and not _faces_scene(prepared, views, empty):
        yield (
            f"{eyes_text(empty, views, prepared)}: nothing is seen: no surface lies in the picture. "
            f"{_where(prepared, views, empty)}; move the eye or its target, or check the unit of the file"
        )
    elif share < SPECK or empty.any():
        every = empty if empty.any() else np.ones(len(views.eyes), np.bool_)
        yield (
            f"{eyes_text(every, views, prepared)}: the scene is a speck: surfaces cover {share:.1%} of the pixels. "
            f"{_where(prepared, views, every)}; {_closer(prepared)}, or check the unit of the file"
        )


def _closer(prepared: Prepared) -> str:
    """Say how a scene becomes larger in the pictures."""
    kind = prepared.job.camera.type
    remedy = {PERSPECTIVE: "move the eye closer, reduce camera.fov", ORTHOGRAPHIC: "reduce camera.height"}
    return remedy.get(kind, "move the eye closer")


def _faces_scene(prepared: Prepared, views: Views, flagged: Flags) -> bool:
    """Return whether all of some eyes have the middle of the scene in their picture: it is too small to be met."""
    eyes = prepared.eyes.at(np.asarray(views.eyes)[flagged].tolist())
    to_scene = prepared.scene.centre - eyes.position
    middles = np.einsum("eji,ej->ei", eyes.world_from_camera[:, :3, :3], to_scene)
    resolution = prepared.job.camera.resolution

    def shown(lens: Lens, middle: Float64) -> bool:
        place, depth = lens.project(resolution, middle[None])
        return bool(depth[0] > 0 and (place >= 0).all() and (place[0] <= resolution).all())

    return all(map(shown, eyes.lenses, middles))


def _where(prepared: Prepared, views: Views, flagged: Flags) -> str:
    """Say where the scene and the first of some eyes are."""
    low, high = bounds(prepared)
    eye = prepared.eyes.position[views.eyes[int(flagged.argmax())]]
    away = float(np.linalg.norm(eye - np.clip(eye, low, high)))
    beside = f"{digits(away, 4)} scene units outside" if away > 0 else "inside"
    return f"The scene reaches from {vector(low)} to {vector(high)}; the eye at {vector(eye)} is {beside}"


def buried_warnings(views: Views, prepared: Prepared) -> Iterator[str]:
    """Find eyes inside a solid."""
    if not (buried := buried_eyes(views)).any():
        return
    closed = (views.surface.mean(axis=1) >= CLOSED)[buried].all()
    where = "the eye is inside a solid" if closed else "the eye is behind the surfaces"
    eye = prepared.eyes.position[views.eyes[int(buried.argmax())]]
    yield (
        f"{eyes_text(buried, views, prepared)}: {where}: it sees back faces only, and no light reaches them. "
        f"Move the eye away from {vector(eye)}"
    )


def crossing_warnings(setup: FrameSetup, prepared: Prepared) -> Iterator[str]:
    """Find where the camera passes through a surface; eyes of a file may jump."""
    if prepared.still or prepared.job.camera.file is not None:
        return
    scene = prepared.scene
    found = crossings(setup, scene, prepared.job, prepared.eyes.position - scene.centre)
    if found:
        frame, triangle = found[0]
        name = scene.material_names[int(scene.material[triangle])]
        more = f", and through others {len(found) - 1} times more" if len(found) > 1 else ""
        yield (
            f"cameras {frame}-{min(frame + 1, prepared.n_cameras - 1)}: the eye passes through a surface of material "
            f'"{name}"{more}; add keys that lead around it'
        )


def bounds(prepared: Prepared) -> tuple[Float64, Float64]:
    """Return the lowest and highest corner of the scene, in the coordinates of its file."""
    corners = prepared.scene.corners
    low, high = corners.min(axis=(0, 1)).astype(np.float64), corners.max(axis=(0, 1)).astype(np.float64)
    return low + prepared.scene.centre, high + prepared.scene.centre


def vector(values: Float64) -> str:
    """Write a point: "[0.2, 1.45, -0.68]"."""
    return f"[{', '.join(digits(float(value), 4) for value in values)}]"
