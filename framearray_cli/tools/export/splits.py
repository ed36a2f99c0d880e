"""Sets for training, validation and testing: which camera and light positions belong to which.

    rule = [AXIS[:SET]=]VALUE or SET=VALUE;  AXIS: "camera" (the default) or a light axis;  SET: train, val or test
    VALUE with a set = places; without one = shares in percent: train/val/test or train/test

Shares are drawn by a hash of seed, axis and index, so that they are the same with every version of every library.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from typing import Any, NamedTuple

from framearray_cli.array.manifest import Manifest
from framearray_cli.array.places import CAMERA_AXIS, read_indices
from framearray_cli.base.errors import JobError
from framearray_cli.base.forms.words import shown
from framearray_cli.base.units import counted

from ..axes import LightIndices, axes_of_groups

SETS = ("train", "val", "test")
OPTION = "--split"
WANTED = "expected shares such as 80/10/10 or 80/20, or places of a set such as test=0-lastx8 or light:test=40-47"
_SHARES = re.compile(r"\d{1,3}(?:\.\d{1,6})?(?:/\d{1,3}(?:\.\d{1,6})?){1,2}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Splits:
    """The sets of the positions along each axis; an axis without sets is not split.

    Attributes:
        cameras: camera -> its set; those that are left out are missing.
        lights: the same, per light axis.
    """

    cameras: Mapping[int, str]
    lights: tuple[Mapping[int, str], ...]

    def of(self, c: int, lights: LightIndices) -> str | None:
        """Return the set of a picture; None if it is left out, as where camera and light are in different sets."""
        axes = zip((self.cameras, *self.lights), (c, *lights), strict=True)
        found = {sets.get(index, "") for sets, index in axes if sets}
        return (found.pop() or None) if len(found) == 1 else None


class _Rule(NamedTuple):
    option: str  # for messages
    name: str  # the set; "": shares
    value: str


def read_splits(
    rules: Sequence[str], seed: int, manifest: Manifest, cameras: Sequence[int], lights: Sequence[LightIndices]
) -> Splits | None:
    """Assign the exported positions to sets.

    Args:
        rules: see the head of this file.
        seed: of shares.

    Returns:
        None without rules.

    Raises:
        JobError: a rule cannot be read, two contradict each other, or a set has no position.
    """
    if not rules:
        return None
    axes = [CAMERA_AXIS, *manifest.axes]
    positions = [tuple(cameras), *(tuple(dict.fromkeys(each)) for each in zip(*lights, strict=True))]
    by_axis = _rules_by_axis(rules, manifest)
    sets = [
        _assign(by_axis[axis], manifest, axis, own, seed) if axis in by_axis else {}
        for axis, own in zip(axes, positions, strict=True)
    ]
    _check_agreement([(axis, set(each.values())) for axis, each in zip(axes, sets, strict=True) if each])
    return Splits(cameras=sets[0], lights=tuple(sets[1:]))


def shared_samples(splits: Splits | None, job: Mapping[str, Any]) -> str:
    """Word that pictures of different sets share samples; "" if they do not, or nothing is known.

    Picture j shows samples of cameras j - N_r to j + N_r, so pictures up to 2 N_r apart may share some.
    """
    reuse = job.get("reuse")
    n_r = reuse.get("n_r") if isinstance(reuse, Mapping) else None
    if splits is None or not splits.cameras or not isinstance(n_r, int) or n_r < 1:
        return ""
    near = 2 * n_r
    sets = splits.cameras
    if all(sets.get(other, name) == name for c, name in sets.items() for other in range(c + 1, c + near + 1)):
        return ""
    return (
        f"cameras up to {counted(near, 'position')} apart share samples (reuse.n_r = {n_r}), and so noise; "
        f"{OPTION} train=PLACES and {OPTION} test=PLACES can leave those between sets out"
    )


def _rules_by_axis(texts: Sequence[str], manifest: Manifest) -> dict[str, list[_Rule]]:
    axes = axes_of_groups(manifest) | {axis: axis for axis in manifest.axes}
    axes |= {"": CAMERA_AXIS, CAMERA_AXIS: CAMERA_AXIS}
    rules: dict[str, list[_Rule]] = {}
    for text in texts:
        head, equals, value = text.partition("=")
        if not equals:
            head, value = "", text
        name = head if head in SETS else head.rpartition(":")[2] if ":" in head else ""
        axis = axes.get(head.rpartition(":")[0] if name else head)
        good = (name in SETS or not name) and (name or _SHARES.fullmatch(value.strip()))
        if axis is None or not good:
            known = ", ".join([CAMERA_AXIS, *manifest.axes])
            raise JobError(OPTION, [f"{WANTED}, got {shown(text)}; axes: {known}"])
        own = rules.setdefault(axis, [])
        if any(not (rule.name and name) or rule.name == name for rule in own):
            raise JobError(OPTION, [f"expected shares or places once per set, got {shown(text)} after {own[0].option}"])
        own.append(_Rule(f"{OPTION} {head or text}", name, value))
    return rules


def _assign(
    rules: Sequence[_Rule], manifest: Manifest, axis: str, positions: Sequence[int], seed: int
) -> dict[int, str]:
    if not rules[0].name:
        return _draw(rules[0], axis, positions, seed, _hint(manifest, axis, len(positions)))
    sets: dict[int, str] = {}
    for rule in rules:
        n = manifest.axes.get(axis, manifest.n_cameras)
        named = set(read_indices(rule.option, rule.value, n, axis)) & set(positions)
        if both := sorted(named & set(sets)):
            raise JobError(rule.option, [f"expected different places, got {both[0]} in {sets[both[0]]} too"])
        if not named:
            raise JobError(
                rule.option,
                [f"expected at least one exported position, got none{_hint(manifest, axis, len(positions))}"],
            )
        sets |= dict.fromkeys(named, rule.name)
    if not any(rule.name == "train" for rule in rules):
        sets |= {k: "train" for k in positions if k not in sets}
    return {k: sets[k] for k in positions if k in sets}


def _hint(manifest: Manifest, axis: str, exported: int) -> str:
    """Return the option that exports all positions of a light axis; "" if they are, as cameras are by default."""
    n = manifest.axes.get(axis, 0)
    option = "--light all" if axis == next(iter(manifest.axes)) else f"--at {axis}=all"
    return f"; {option} exports all {n}" if exported < n else ""


def _draw(rule: _Rule, axis: str, positions: Sequence[int], seed: int, hint: str) -> dict[int, str]:
    """Draw shares: sets get whole numbers of positions by the largest remainder, and each at least one."""
    shares = [float(part) for part in rule.value.split("/")]
    names = SETS if len(shares) == 3 else ("train", "test")
    if abs(sum(shares) - 100) > 1e-6:
        raise JobError(rule.option, [f"expected shares that add up to 100, got {sum(shares):g}"])
    wanted = {name: share for name, share in zip(names, shares, strict=True) if share}
    n = len(positions)
    if n < len(wanted) or len(wanted) < 2:
        least = f"at least {counted(len(wanted), 'position')}" if len(wanted) > 1 else "at least two sets"
        found = f"{n}{hint}" if len(wanted) > 1 else "1"
        raise JobError(rule.option, [f"expected {least} on axis {axis}, got {found}"])
    sizes = {name: max(1, int(n * share / 100)) for name, share in wanted.items()}
    while sum(sizes.values()) != n:
        step = 1 if sum(sizes.values()) < n else -1
        able = [name for name in sizes if step > 0 or sizes[name] > 1]
        sizes[max(able, key=lambda name: step * (n * wanted[name] / 100 - sizes[name]))] += step
    order = sorted(positions, key=lambda k: sha256(f"{seed}/{axis}/{k}".encode()).digest())
    sets: dict[int, str] = {}
    for name in reversed(sizes):  # tests first: they stay tests while the others change
        sets |= dict.fromkeys(order[len(sets) : len(sets) + sizes[name]], name)
    return {k: sets[k] for k in positions}


def _check_agreement(found: Sequence[tuple[str, set[str]]]) -> None:
    """Check that there are pictures in each set: axes have the same sets."""
    names = set[str]().union(*(names for _, names in found))
    if len(names) < 2:
        raise JobError(OPTION, [f"expected train and another set, got {', '.join(names)}"])
    for axis, own in found:
        lacking = [name for name in SETS if name in names | {"train"} and name not in own]
        if lacking:
            raise JobError(OPTION, [f"expected the same sets on each axis, got no {', '.join(lacking)} on axis {axis}"])
