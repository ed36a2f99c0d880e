"""Places that are named on the command line."""

from itertools import pairwise

import pytest
from support.boxarrays import grouped_manifest, plain_manifest

from framearray_cli.base.errors import JobError
from framearray_cli.tools.places import indices, light_places, plain_names, spread_with_ends


def test_places_are_read() -> None:
    assert indices("--light", "all", 3) == (0, 1, 2)
    assert indices("--light", "0, -1,first,last,50%", 5) == (0, 4, 2)
    assert indices("--light", "12.5 %", 9) == (1,)
    assert indices("--light", "50%", 4) == (2,)
    assert indices("--light", "50%", 1) == (0,)


@pytest.mark.parametrize("text", ["", "x", "1.5", "0,", "101%", "1;2", "all,1"])
def test_what_is_no_place_is_refused(text: str) -> None:
    with pytest.raises(JobError, match=r"--light: expected"):
        indices("--light", text, 5)


@pytest.mark.parametrize("text", ["5", "-6", "0,7"])
def test_places_outside_are_refused(text: str) -> None:
    with pytest.raises(JobError, match=r"--light: expected 0 to 4, or -5 to -1, got -?\d"):
        indices("--light", text, 5)


def test_spread_is_even_with_both_ends() -> None:
    assert spread_with_ends(3, 8) == (0, 1, 2)
    assert spread_with_ends(192, 3) == (0, 96, 191)
    assert spread_with_ends(7, 1) == (3,)
    for n, most in ((24, 12), (192, 12), (48, 8), (9, 8)):
        chosen = spread_with_ends(n, most)
        steps = {b - a for a, b in pairwise(chosen)}
        assert (len(chosen), chosen[0], chosen[-1]) == (most, 0, n - 1)
        assert max(steps) - min(steps) <= 1


def test_light_places_combine_the_axes() -> None:
    manifest = grouped_manifest()
    assert dict(manifest.axes) == {"light": 3, "lamps": 2}
    assert light_places(manifest, None, (), "50%") == [(1, 1)]
    assert light_places(manifest, "0,-1", ["lamps=all"], "50%") == [(0, 0), (0, 1), (2, 0), (2, 1)]
    assert len(light_places(manifest, None, (), "all")) == 6
    assert light_places(plain_manifest(), "last", (), "50%") == [(2,)]


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
        light_places(grouped_manifest(), light, at, "all")


def test_names_of_axes_are_plain_and_differ() -> None:
    assert plain_names({"light": 2, "lamps": 3}) == {"light": "light", "lamps": "light_lamps"}
    names = plain_names({"light": 2, "a b": 3, "a/b": 2, "ö": 1})
    assert names == {"light": "light", "a b": "light_a_b", "a/b": "light_a_b_", "ö": "light_"}
