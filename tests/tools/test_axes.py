"""Choices along the axes of an array."""

from itertools import pairwise

import pytest
from support.boxarrays import grouped_manifest, plain_manifest

from framearray_cli.base.errors import JobError
from framearray_cli.tools.axes import evenly_spaced, read_light_indices


def test_evenly_spaced_indices_have_both_ends() -> None:
    assert evenly_spaced(3, 8) == (0, 1, 2)
    assert evenly_spaced(192, 3) == (0, 96, 191)
    assert evenly_spaced(7, 1) == (3,)
    for n, most in ((24, 12), (192, 12), (48, 8), (9, 8)):
        chosen = evenly_spaced(n, most)
        steps = {b - a for a, b in pairwise(chosen)}
        assert (len(chosen), chosen[0], chosen[-1]) == (most, 0, n - 1)
        assert max(steps) - min(steps) <= 1


def test_light_indices_combine_the_axes() -> None:
    manifest = grouped_manifest()
    assert dict(manifest.axes) == {"light": 3, "lamps": 2}
    assert read_light_indices(manifest, None, (), "50%") == [(1, 1)]
    assert read_light_indices(manifest, "0,-1", ["lamps=all"], "50%") == [(0, 0), (0, 1), (2, 0), (2, 1)]
    assert len(read_light_indices(manifest, None, (), "all")) == 6
    assert read_light_indices(plain_manifest(), "last", (), "50%") == [(2,)]


@pytest.mark.parametrize(
    ("light", "at", "message"),
    [
        (None, ["moon=1"], r"--at: expected AXIS=PLACES with one of the axes light \(0 to 2\), lamps \(0 to 1\)"),
        (None, ["lamps"], "--at: expected AXIS=PLACES"),
        (None, ["lamps=0", "lamps=1"], "--at: .* got twice the same axis"),
        (None, ["lamps=2"], r"--at lamps: expected one of 2 positions of lamps \(0 to 1, or -2 to -1\), got 2"),
        ("0", ["light=1"], "--light: expected either this or --at light"),
    ],
)
def test_unknown_axes_are_named(light: str | None, at: list[str], message: str) -> None:
    with pytest.raises(JobError, match=message):
        read_light_indices(grouped_manifest(), light, at, "all")
