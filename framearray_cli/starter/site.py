"""Explore a scene: which way is up, whether it is a room, a street or a thing, and how large it is."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.base.errors import SceneError
from framearray_cli.engine.embree.embreescene import EmbreeScene
from framearray_cli.job.job import Z_UP_FORMATS
from framearray_cli.scene.files import Stage
from framearray_cli.scene.scene import Scene

from .kind import reason_for_a_thing
from .options import StartOptions, Up
from .rays import Probe
from .room import Room, bounds, find_room, turn_to_rooms
from .scale import NAMES, Unit, guess_unit, lies_on_its_side, unit_of, unit_of_a_thing

MAY_LIE = (".obj", ".off")  # formats that do not say which axis points up, and are written with y or z


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Site:
    """A scene and what rays found in it.

    Attributes:
        up: number of the up axis.
        room: where one can be inside; None for a thing.
        unit: of length, as it seems; None where nothing tells.
        size: largest extent.
        about: what was found, and why the scene is taken for what it is.
        from_above: whether a thing is best looked into from above.
        given: unit of length that the file gives.
    """

    probe: Probe
    up: int
    room: Room | None
    unit: Unit | None
    size: float
    about: tuple[str, ...]
    from_above: bool = False
    given: Unit | None = None

    @property
    def centre(self) -> Float64:
        """Of the scene, (3,): what file coordinates have beyond centred ones."""
        return self.probe.scene.centre

    @property
    def up_name(self) -> Literal["y", "z"]:
        """As the job file has it."""
        return "z" if self.up == 2 else "y"

    @property
    def metre(self) -> float | None:
        """Its length in scene units, as it seems."""
        return None if self.unit is None else self.unit.metre


@contextmanager
def explored(scene: Scene, file: Path, options: StartOptions, stage: Stage) -> Iterator[Site]:
    """Explore a scene, and keep it open for more rays.

    Args:
        options: whether it is a room and which axis points up, where the user says so.
        stage: may say which axis points up, and the unit of length.

    Raises:
        SceneError: it should be a room, and has no inside.
    """
    suffix, inside = file.suffix.lower(), options.inside
    up, about = _find_up(scene, suffix, options.up, stage)
    with EmbreeScene(scene) as embree:
        probe = Probe(scene=scene, embree=embree)
        low, high = bounds(probe)
        site = Site(probe=probe, up=up, room=None, unit=None, size=float((high - low).max()), about=tuple(about))
        site = replace(site, given=unit_of(stage.metres))
        if inside is False:
            yield _thing(site, "It is looked at from outside, as --outside asks for.", suffix)
        else:
            yield _find_inside(site, file, inside)


def _find_up(scene: Scene, suffix: str, asked: Up | None, stage: Stage) -> tuple[int, list[str]]:
    """Return the number of the up axis, and a reason where one is needed."""
    if asked is not None:
        return (2 if asked == "z" else 1), [f"{asked} is taken for up, as --up asks for."]
    if suffix in Z_UP_FORMATS or stage.up == "z":
        return 2, []
    if suffix in MAY_LIE and lies_on_its_side(scene.corners.reshape(-1, 3).astype(np.float64)):
        return 2, ["It lies on its side if y points up, so z is taken for up; --up y says otherwise."]
    return 1, []


def _thing(site: Site, why: str, suffix: str, *, from_above: bool = False) -> Site:
    """A site without a room."""
    unit = site.given or unit_of_a_thing(site.size, suffix)
    about = [*site.about, why]
    if unit is not None:
        metres = f", {site.size / unit.metre:.2g} m" if unit.name != "m" else ""
        about.append(
            f"Its unit of length is taken for the {NAMES[unit.name]}: it is {_number(site.size)} units long{metres}."
        )
    return replace(site, unit=unit, about=tuple(about), from_above=from_above)


def _find_inside(site: Site, file: Path, inside: bool | None) -> Site:
    probe, up, suffix = site.probe, site.up, file.suffix
    room, share = find_room(probe, up)
    if facing := turn_to_rooms(probe, share):
        other, more = find_room(facing, up)
        if more > share:
            probe, room, share = facing, other, more
    if inside:  # perhaps its faces are turned outwards, and only cupboards are closed from their fronts
        turned = replace(probe, turned=True)
        other, more = find_room(turned, up)
        if more > share or room is None:
            probe, room, share = turned, other, more
        if room is None:
            raise SceneError(f"{file}: --inside: nothing in it looks like the inside of a room")
    if room is None:
        why = "There is no room in it to be inside of, so it is looked at from outside; --inside says otherwise."
        return _thing(site, why, suffix)
    tall = float(np.ptp(probe.scene.corners[..., up])) if room.roofless else room.height
    unit = site.given or guess_unit(tall, suffix, roofless=room.roofless)
    reason = None if inside else reason_for_a_thing(probe, room, share, unit)
    if reason is not None:
        return _thing(site, f"{reason}; --inside says otherwise.", suffix, from_above=room.roofless)
    found = "inside, under the sky" if room.roofless else "inside"
    taken = "a street or a yard" if room.roofless else "a room"
    why = f"{share:.0%} of its bounds are {found}, so it is taken for {taken}; --outside says otherwise."
    if inside:
        why = "It is taken for a room, as --inside asks for."
    return replace(site, probe=probe, room=room, unit=unit, about=(*site.about, why, _size_of(room, unit)))


def _size_of(room: Room, unit: Unit | None) -> str:
    """What the unit is taken for, and what follows."""
    what, how = ("The walls around are", "away") if room.roofless else ("The room is", "high")
    tall = f"{_number(room.height)} units {how}"
    if unit is None:
        return f"{what} {tall}, which fits no common unit of length; the eye is halfway up."
    metres = f", {room.height / unit.metre:.2g} m" if unit.name != "m" else ""
    return f"Its unit of length is taken for the {NAMES[unit.name]}: {what.lower()} {tall}{metres}."


def _number(value: float) -> str:
    """Three digits, without an exponent where people would write none."""
    return f"{float(f'{value:.3g}'):.7g}"
