"""Places along an axis, as the command line names them."""

from itertools import pairwise

import pytest
from support.boxarrays import grouped_manifest, plain_manifest

from framearray_cli.base.errors import JobError
from framearray_cli.tools.places import evenly_spaced, read_indices, read_light_indices


def test_places_are_read() -> None:
    assert read_indices("--light", "all", 3) == (0, 1, 2)
    assert read_indices("--light", "0, -1,first,last,50%", 5) == (0, 4, 2)
    assert read_indices("--light", "12.5 %", 9) == (1,)
    assert read_indices("--light", "50%", 4) == (2,)
    assert read_indices("--light", "50%", 1) == (0,)


@pytest.mark.parametrize("text", ["", "x", "1.5", "0,", "101%", "1;2", "all,1"])
def test_what_is_no_place_is_refused(text: str) -> None:
    with pytest.raises(JobError, match=r"--light: expected"):
        read_indices("--light", text, 5)


@pytest.mark.parametrize("text", ["5", "-6", "0,7"])
def test_places_outside_the_axis_are_refused(text: str) -> None:
    with pytest.raises(JobError, match=r"--light: expected 0 to 4, or -5 to -1, got -?\d"):
        read_indices("--light", text, 5)


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
        (None, ["sun=1"], r"--at: expected AXIS=PLACES with one of the axes light \(0 to 2\), lamps \(0 to 1\)"),
        (None, ["lamps"], "--at: expected AXIS=PLACES"),
        (None, ["lamps=0", "lamps=1"], "--at: .* got twice the same axis"),
        (None, ["lamps=2"], r"--at lamps: expected 0 to 1, or -2 to -1, got 2"),
        ("0", ["light=1"], "--light: expected either this or --at light"),
    ],
)
def test_unknown_axes_are_named(light: str | None, at: list[str], message: str) -> None:
    with pytest.raises(JobError, match=message):
        read_light_indices(grouped_manifest(), light, at, "all")
