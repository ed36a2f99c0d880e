"""All warnings of a job, from its values and from pilots.

Values: typing errors and mistaken units, without a ray. Pilots: eyes that see nothing, or only the inside of a solid;
cameras that pass through walls; sources whose light reaches no visible surface; pictures that are black or clipped;
light from cells that is far from the light of paths.
"""

import math
from collections.abc import Iterator

import numpy as np

from framearray_cli.array.images import FOR_SCREENS
from framearray_cli.base.arrays import Flags, Float32, Float64, box_of
from framearray_cli.base.lens import ORTHOGRAPHIC, PERSPECTIVE, Lens
from framearray_cli.base.units import agree, digits
from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.engine.inputs.lights import DIRECTIONAL, MESH
from framearray_cli.engine.terms.ambient.intensity import Accuracy, Ambient
from framearray_cli.job.job import Job
from framearray_cli.job.sources import DirectionalKey, PanelKey, PointKey
from framearray_cli.scene.scene import Scene

from ..prepare import Prepared
from .views import BACK, Views, crossings, is_inside_solid, lights_text, render_views, runs_text

# Fields of view up to pi look like radians; a telescope's picture is rarely meant.
RADIANS = math.pi
# Colours are factors from 0 to 1, some a little above; 100 are per cent, and 255 codes of 8 bits.
MOST_COLOUR = 10.0
COLOUR_REMEDY = "expected factors from 0 to 1: divide 8-bit codes by 255, and convert them from sRGB to linear values"
_STRENGTHS = ("intensity", "irradiance", "power", "radiance")
# Of the size of the scene: where surfaces obscure each other from farther away, all of them are obscured.
FAR_RANGE = 10.0
# Share of the distance of visible surfaces: about a pixel of a picture with 300 rows. Closer surfaces look like one.
NEAR_RANGE = 1 / 300
# Errors beyond which images are wrong, over the mean indirect light: of its mean, and of single points.
MOST_BIAS, MOST_ERROR = 0.05, 0.25
# Standard errors by which an error must lie beyond.
SURE = 2.0
# Share of all pixels looked through that must see a surface; below it the scene is a speck.
SPECK = 0.01
# Share of an eye's pixels that see a surface, from which on it is closed in.
CLOSED = 0.995
# Share of what is seen in black pictures, below which light comes through cracks; a lamp that is too weak lights more.
SCARCE = 0.1
# A screen shows values from 0 to 1. Linear formats keep what lies beyond, but two stops more are no exposure.
CLIPPED, TOO_BRIGHT = 1.0, 4.0
# Three of the 256 codes of a screen.
DARK = 1e-3
# Shares of the pixels that see surfaces, from which on a picture is lost.
MOSTLY_CLIPPED, MOSTLY_DARK = 0.6, 0.95
# Share of the pictures of a camera or light position, from which on it is named; fewer may be meant.
WHOLE = 0.9
# Pixels with a surface that a picture needs to be judged.
ENOUGH = 16
# Mid-grey, to which advice leads.
MIDDLE = 0.2
# A background that fills half of the picture, is clipped by two stops, and outshines what is seen before it.
MUCH_SKY, BRIGHT_SKY, OUTSHINES = 0.5, 4.0, 100.0


def typed_warnings(job: Job) -> Iterator[str]:
    """Find values that were most likely meant in another unit."""
    fovs = [key.fov for key in job.camera.keys if key.fov is not None] or [job.camera.fov]
    fov, degrees = min(fovs), math.degrees(min(fovs))
    if fov <= RADIANS and job.camera.type == PERSPECTIVE:
        yield (
            f"camera.fov: {fov:g} degrees is the view of a telescope; if radians were meant, they are {degrees:.3g} "
            f"degrees: set fov = {degrees:.3g}"
        )
    for i, source in enumerate(job.light.sources):
        keys = {
            k: key for k, key in enumerate(source.key_frames) if isinstance(key, PointKey | DirectionalKey | PanelKey)
        }
        bad = {k: key.color for k, key in keys.items() if key.color is not None and max(key.color) > MOST_COLOUR}
        for k, colour in list(bad.items())[:1]:
            strength = next(name for name in _STRENGTHS if getattr(keys[k], name, None) is not None)
            more = f", and {len(bad) - 1} more" if len(bad) > 1 else ""
            values = ", ".join(f"{value:g}" for value in colour)
            yield (
                f"light.sources[{i}].keys[{k}].color{more}: [{values}] multiplies the {strength} by up to "
                f"{max(colour):g}; {COLOUR_REMEDY}"
            )


def layer_warnings(job: Job, scene: Scene) -> Iterator[str]:
    """Find layers that would be empty."""
    if job.output.aov["uv"] and not len(scene.uvs):
        yield (
            "output.uv: the scene has no texture coordinates, so the layer would be 0 everywhere; leave the key out, "
            "or add them to the scene file"
        )


def range_warnings(job: Job, size: float, distances: "np.ndarray") -> Iterator[str]:
    """Find a range of obscurance that hides all indirect light, or that no picture can show.

    Args:
        size: diagonal of the scene.
        distances: of the surfaces seen.
    """
    wanted = job.d_max
    if wanted > FAR_RANGE * size:
        yield (
            f"obscurance.range: {wanted:g} scene units, in a scene of {digits(size, 3)}: everything obscures "
            f"everything, and indirect light is almost black; about {digits(size / 4, 1)} would suit the scene"
        )
    elif len(distances) and wanted < NEAR_RANGE * (middle := float(np.median(distances))):
        yield (
            f"obscurance.range: {wanted:g} scene units, where surfaces are seen from {digits(middle, 3)} away: "
            "obscurance is narrower than a pixel, and indirect light is flat; about "
            f"{digits(min(size, 2 * middle) / 4, 1)} would suit the scene"
        )


def indirect_warnings(job: Job, setup: FrameSetup, accuracy: Accuracy | None) -> Iterator[str]:
    """Find cells that are too large, too small, or have too few samples: errors exceed the usual, and their noise."""
    if accuracy is None or setup.indirect.cells is None:
        return
    bias, error = abs(accuracy.bias) - SURE * accuracy.bias_error, accuracy.error - SURE * accuracy.error_error
    if not (bias > MOST_BIAS or error > MOST_ERROR):
        return
    remedy = "leave indirect.cell out, or raise indirect.samples"
    if job.indirect.cell is None:
        remedy = "raise indirect.samples, or set a smaller indirect.cell with it"
    edge = digits(setup.indirect.cells.grid.edge, 2)
    yield (
        f"indirect.cell, indirect.samples: {accuracy.note}, with cells of {edge} scene units and "
        f"{job.indirect.samples:,} samples; {remedy}"
    )


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
    if flagged.all():
        return "every camera position"
    return f"{agree(int(flagged.sum()), 'camera', 'cameras')} {runs_text(list(flagged), list(views.eyes))}"


def empty_warnings(views: Views, prepared: Prepared) -> Iterator[str]:
    """Find eyes that see nothing, or a scene that is a speck in the pictures."""
    empty, share = views.empty, float(views.surface.mean())
    if empty.any() and not _faces_scene(prepared, views, empty):
        yield (
            f"{eyes_text(empty, views, prepared)}: nothing is seen: no surface lies in the picture. "
            f"{_where(prepared, views, empty)}; move the eye or its target, or check the unit of the file"
        )
    elif share < SPECK or empty.any():
        every = empty if empty.any() else np.ones(len(views.eyes), np.bool_)
        remedies = {PERSPECTIVE: "move the eye closer, reduce camera.fov", ORTHOGRAPHIC: "reduce camera.height"}
        remedy = remedies.get(prepared.job.camera.type, "move the eye closer")
        yield (
            f"{eyes_text(every, views, prepared)}: the scene is a speck: surfaces cover {share:.1%} of the pixels. "
            f"{_where(prepared, views, every)}; {remedy}, or check the unit of the file"
        )


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
    place = f"{digits(away, 4)} scene units outside" if away > 0 else "inside"
    return f"The scene reaches from {vector(low)} to {vector(high)}; the eye at {vector(eye)} is {place}"


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
    """Find where the camera passes through a surface; poses of every frame, such as from a file, may jump."""
    if prepared.still or len(prepared.job.camera.keys) == prepared.n_cameras:
        return
    scene = prepared.scene
    found = crossings(prepared, setup)
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
    low, high = box_of(prepared.scene.corners).astype(np.float64) + prepared.scene.centre
    return low, high


def vector(values: Float64) -> str:
    """Write a point: "[0.2, 1.45, -0.68]"."""
    return f"[{', '.join(digits(float(value), 4) for value in values)}]"


def light_warnings(views: Views, setup: FrameSetup, prepared: Prepared) -> Iterator[str]:
    """Find sources that light nothing at any of their positions, and lamps that pass through a solid."""
    if not views.reflects.any():  # what is black needs no light, and none is traced to it
        return
    # whether each source lights anything that is seen at each plane, (n_sources, P)
    reached = np.any(views.lit, axis=(0, 1))[None] if views.reached is None else views.reached > 0
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


def level_warnings(views: Views, setup: FrameSetup, prepared: Prepared, counted: Flags, named: Flags) -> Iterator[str]:
    """Find pictures that are clipped or black.

    Args:
        counted: (E,) eyes that are judged: no other warning names them.
        named: (K,) light positions that another warning names, and that may be dark.
    """
    job = prepared.job
    factor = np.float32(2.0**job.output.exposure if job.output.format in FOR_SCREENS else 1.0)
    values: Float32 = views.radiance.max(axis=-1) * factor  # as the format shows them, (E, n, K)
    yield from _sky_warnings(views, job, values)
    counted = counted & (views.surface.sum(axis=1) >= ENOUGH)
    if not counted.any():
        return
    limit = CLIPPED if job.output.format in FOR_SCREENS else TOO_BRIGHT
    clipped = _shares(values > limit, views) * counted[:, None]
    bad = (clipped > MOSTLY_CLIPPED) & counted[:, None]
    if place := _place(bad, counted, views, prepared, np.ones(bad.shape[1], np.bool_)):
        bright = values[np.broadcast_to(bad[:, None] & views.surface[..., None], values.shape)]
        middle = float(np.median(bright))
        yield (
            f"{place}: {float(clipped[bad].mean()):.0%} of the pixels that see surfaces are clipped: the middle one "
            f"has {digits(middle, 3)}, and a screen shows up to 1; {_advice(job, middle)}"
        )
    yield from _dark_warnings(views, setup, prepared, values, counted, named)


def _dark_warnings(
    views: Views, setup: FrameSetup, prepared: Prepared, values: Float32, counted: Flags, named: Flags
) -> Iterator[str]:
    """Find pictures that are black; see `level_warnings`."""
    lit = (views.positions.bright | (not views.positions.bright.any())) & ~named
    dark = _shares(values < DARK, views)
    bad = (dark > MOSTLY_DARK) & counted[:, None] & lit
    if place := _place(bad, counted, views, prepared, lit):
        black = values[np.broadcast_to(bad[:, None] & views.surface[..., None], values.shape)]
        level = float(np.percentile(black, 90))
        reason = scarce_light(views, setup, prepared, bad) or _dark_reason(views, prepared, level)
        yield f"{place}: {float(dark[bad].mean()):.0%} of the pixels that see surfaces are black; {reason}"


def _shares(flagged: Flags, views: Views) -> Float64:
    """Return the share of the pixels with a surface that are flagged, (E, K)."""
    on_surface = (flagged & views.surface[..., None]).sum(axis=1)
    shares: Float64 = on_surface / np.maximum(views.surface.sum(axis=1), 1)[:, None]
    return shares


def _place(bad: Flags, counted: Flags, views: Views, prepared: Prepared, lit: Flags) -> str:
    """Name the camera or light positions of bad pictures; "" if there are none."""
    if not bad.any() or not lit.any():
        return ""
    judged = bad[counted][:, lit]
    if judged.mean() >= WHOLE:
        return "all pictures"
    by_light, by_eye = judged.mean(axis=0) >= WHOLE, judged.mean(axis=1) >= WHOLE
    places = []
    if by_eye.any():
        flagged = np.zeros(len(counted), np.bool_)
        flagged[np.flatnonzero(counted)[by_eye]] = True
        places.append(eyes_text(flagged, views, prepared))
    if by_light.any():
        flagged = np.zeros(len(lit), np.bool_)
        flagged[np.flatnonzero(lit)[by_light]] = True
        places.append(lights_text(list(flagged), views.positions))
    return " and ".join(places)


def _advice(job: Job, level: float) -> str:
    factor = level / MIDDLE
    many = f"{float(f'{factor:.1g}'):,.0f}" if factor >= 2 else f"{factor:.2g}"
    if job.output.format in FOR_SCREENS:
        return f"divide the strength of the light by {many}, or set output.exposure = {_stops(job, factor):.1f}"
    return f"divide the strength of the light by {many}"


def _stops(job: Job, factor: float) -> float:
    return float(job.output.exposure - np.log2(factor))


def _dark_reason(views: Views, prepared: Prepared, level: float) -> str:
    """Say why pictures are black, and the remedy."""
    job = prepared.job
    if not (views.reflects | views.mirrors).any():
        if prepared.scene.has_mirrors and job.specular.depth == 0:
            return "mirrors are black, as specular.depth = 0"
        return "what is seen reflects no light: its materials are black; [scene.materials] replaces them"
    if not views.positions.bright.any() and not any(job.scene.background):
        return "all sources are off, and the background is black"
    factor = MIDDLE / max(level, float(np.finfo(np.float32).tiny))
    if level <= 0 or not np.isfinite(factor):
        return "no light arrives; move or add a source"
    many = f"{float(f'{factor:.1g}'):,.0f}"
    advice = f"multiply the strength of the light by about {many}"
    if job.output.format in FOR_SCREENS and _stops(job, 1 / factor) < 32:
        advice += f", or set output.exposure = {_stops(job, 1 / factor):.1f}"
    low, high = bounds(prepared)
    size = f"{float(np.linalg.norm(high - low)):,.4g}"
    return f"{advice}; the light of a lamp falls with the square of the distance, and the scene is {size} units across"


def _sky_warnings(views: Views, job: Job, values: Float32) -> Iterator[str]:
    """Find a background that outshines all that is seen before it."""
    sky = values[~views.surface]
    if (~views.surface).mean() < MUCH_SKY or not len(sky) or not views.surface.any():
        return
    background, surfaces = float(np.median(sky)), float(np.median(values[views.surface]))
    if background > BRIGHT_SKY and background > OUTSHINES * surfaces:
        yield (
            f"scene.background: {digits(background, 3)}, where surfaces have {digits(surfaces, 3)} and a screen shows "
            "up to 1: only outlines are seen; lower the background, or strengthen the light"
        )


def find_warnings(prepared: Prepared, setup: FrameSetup, ambient: Ambient) -> tuple[str, ...]:
    """Render pilots, and describe what would make an array useless: number, place and remedy.

    No image depends on it.

    Args:
        setup: for all light positions.
        ambient: for all light positions.
    """
    views = render_views(prepared, setup, ambient)
    return (*indirect_warnings(prepared.job, setup, ambient.accuracy), *_warnings(views, prepared, setup))


def _warnings(views: Views, prepared: Prepared, setup: FrameSetup) -> Iterator[str]:
    job = prepared.job
    yield from typed_warnings(job)
    yield from layer_warnings(job, prepared.scene)
    yield from empty_warnings(views, prepared)
    empty, buried = views.empty, buried_eyes(views)
    if empty.all():
        return
    yield from buried_warnings(views, prepared)
    yield from crossing_warnings(setup, prepared)
    low, high = bounds(prepared)
    yield from range_warnings(job, float(np.linalg.norm(high - low)), views.distance[views.surface])
    if (empty | buried).all():
        return
    lights = list(light_warnings(views, setup, prepared))
    yield from lights
    named = dark_light_positions(views) & bool(lights)
    yield from level_warnings(views, setup, prepared, ~(empty | buried), named)
