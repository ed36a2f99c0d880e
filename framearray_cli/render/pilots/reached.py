"""Warnings of sources whose light reaches nothing that is seen."""

from collections.abc import Iterator

import numpy as np

from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.engine.inputs.lights import DIRECTIONAL, MESH

from ..prepare import Prepared
from .positions import lights_text
from .rays import Flags, is_inside_solid
from .seen import bounds, vector
from .views import Views

# Share of what is seen in black pictures, below which light comes through cracks; a lamp that is too weak lights more.
SCARCE = 0.1


def light_warnings(views: Views, setup: FrameSetup, prepared: Prepared) -> Iterator[str]:
    """Find sources that light nothing at any of their positions, and lamps that pass through a solid."""
    if not views.reflects.any():  # what is black needs no light, and none is traced to it
        return
    reached = _reached(views)
    planes = list(views.positions.planes)
    on = np.asarray(setup.lights.lit[:, planes] > 0)
    joint = len(reached) < len(on)  # very many sources are judged together
    if joint:
        on = np.asarray(on.any(axis=0))[None]
    for s in range(len(on)):
        if not on[s].any() or (reached[s] & on[s]).all():
            continue
        if not joint and prepared.lights.sources[s].part_of is not None:  # the sky around a hidden sun may do
            continue
        name = "every source" if joint else _name(prepared, s)
        dark = on[s] & ~reached[s]
        if not reached[s].any():
            yield f"{name} reaches nothing that is seen: {_reason(setup, prepared, s, planes[int(dark.argmax())])}"
        elif not joint and (buried := [p for p in np.flatnonzero(dark) if _is_buried(setup, prepared, s, planes[p])]):
            steps = [bool(set(together) & set(buried)) for together in views.positions.together]
            at = vector(prepared.lights.sources[s].vector[planes[buried[0]]])
            yield (
                f"{lights_text(steps, views.positions)}: {name} is inside a solid, and reaches nothing that is seen; "
                f"move it away from {at}"
            )


def dark_light_positions(views: Views) -> Flags:
    """Return the light positions at which nothing that is seen is lit, though sources shine, (K,)."""
    by_plane = np.asarray(views.lit.any(axis=(0, 1)))
    lit = np.array([by_plane[list(planes)].any() for planes in views.positions.together])
    return np.asarray(views.positions.bright & ~lit)


def scarce_light(views: Views, setup: FrameSetup, prepared: Prepared, bad: Flags) -> str:
    """Say why light comes only through cracks to some pictures, (E, K); "" if it does not."""
    steps = [k for k in np.flatnonzero(bad.any(axis=0)) if views.positions.bright[k]]
    seen = np.asarray(views.reflects[bad.any(axis=1)])
    if not steps or not seen.any():
        return ""
    planes = sorted({p for k in steps for p in views.positions.together[k]})
    lit = np.asarray(views.lit[bad.any(axis=1)][..., planes].any(axis=-1))
    share = float(lit[seen].mean())
    if share > SCARCE:
        return ""
    on = setup.lights.lit[:, [views.positions.planes[p] for p in planes]] > 0
    s, p = (int(number) for number in np.argwhere(on)[0])
    reason = _reason(setup, prepared, s, views.positions.planes[planes[p]])
    return f"light reaches only {share:.1%} of what is seen: {_name(prepared, s)}: {reason}"


def _reached(views: Views) -> Flags:
    """Return whether each source lights anything that is seen at each plane, (n_sources, P)."""
    if views.reached is not None:
        return np.asarray(views.reached > 0)
    return np.asarray(views.lit.any(axis=(0, 1)))[None]


def _name(prepared: Prepared, s: int) -> str:
    part_of = prepared.lights.sources[s].part_of
    i = s if part_of is None else part_of
    group = prepared.job.light.sources[i].group
    return f"light.sources[{i}]" + (f' of group "{group}"' if group else "")


def _is_buried(setup: FrameSetup, prepared: Prepared, s: int, plane: int) -> bool:
    position = np.asarray(setup.lights.vector[s, :, plane])
    return bool(setup.lights.kind[s] not in (DIRECTIONAL, MESH)) and is_inside_solid(setup, prepared.scene, position)


def _reason(setup: FrameSetup, prepared: Prepared, s: int, plane: int) -> str:
    """Say why a source lights nothing, and the remedy."""
    values = prepared.lights.sources[s].vector[plane]
    low, high = bounds(prepared)
    if (emitter := prepared.lights.sources[s].emitter) is not None:
        sides = "" if emitter.two_sided else ", or it shines the other way; try two_sided = true"
        return f'surfaces hide the material "{emitter.material}" from all that is seen{sides}'
    if prepared.lights.sources[s].environment is not None:
        return "surfaces hide the sky from all that is seen; open the scene"
    if setup.lights.kind[s] == DIRECTIONAL:
        axis = 2 if prepared.job.scene.up == "z" else 1
        if values[axis] > 0:
            return (
                f"its direction {vector(values)} leads upwards, so that it shines from below; direction is the way "
                f"that light travels: turn it round, to {vector(-values)}"
            )
        return "surfaces block it; open the scene towards it, or change its direction"
    if ((values < low) | (values > high)).any():
        return (
            f"the lamp at {vector(values)} is outside the scene, which reaches from {vector(low)} to {vector(high)}; "
            "move it to where the eyes are"
        )
    if _is_buried(setup, prepared, s, plane):
        return f"the lamp at {vector(values)} is inside a solid; move it into the open"
    if prepared.lights.sources[s].shines_one_way:
        return f"the lamp at {vector(values)} shines past all that is seen, or surfaces hide it; turn it or move it"
    return f"surfaces hide the lamp at {vector(values)} from all that is seen; move it to where the eyes are"
