"""Files of measured lamps: every variant, and broken ones with one clear message each."""

import re
from pathlib import Path
from random import Random

import pytest
from support.iesfiles import DOWN, LONG, TILT, VARIANTS, glow, ies
from support.lightjobs import problems, read_lit

from framearray_cli.job.ies import read_photometry
from framearray_cli.job.job import Job
from framearray_cli.job.read import job_table
from framearray_cli.job.rowfile import RowFileError

LAMP = {"type": "point", "keys": [{"frame": 0, "position": [0.0, 1.0, 0.0]}]}


def written(folder: Path, text: str | bytes) -> Path:
    file = folder / "lamp.ies"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return file


@pytest.mark.parametrize("name", VARIANTS)
def test_every_variant_is_read(name: str, tmp_path: Path) -> None:
    found = read_photometry(written(tmp_path, VARIANTS[name]))
    factor = {"multiplier": 2.5, "ballast factors": 0.72}.get(name, 1)
    assert found.factor == pytest.approx(factor)
    assert found.kind == ("B" if name.startswith("type B") else "C")
    assert len(found.candela) == len(found.horizontal_deg)
    assert all(len(row) == len(found.vertical_deg) for row in found.candela)
    assert found.tilted == (name == "tilt")
    if name == "exponents":
        assert found.candela == ((1500, 1200, 0.5, 0),)
    elif name == "circle without its end":
        assert found.horizontal_deg == (0, 90, 180, 270, 360)
        assert found.candela[-1] == found.candela[0]
    elif name != "whole circle":
        assert found.candela == tuple(tuple(glow(v, h) for v in found.vertical_deg) for h in found.horizontal_deg)


def test_factors_of_tilts_in_another_file_are_left_out(tmp_path: Path) -> None:
    assert read_photometry(written(tmp_path, ies(tilt="TILT=tilt.dat\n"))).tilted


BROKEN = [
    (b"", 'line 1: expected a line "TILT=NONE" before the numbers, found none; is it an IES file?'),
    (b"\x7fELF\0\0\0\1", "expected a text file of IES LM-63, got binary data"),
    (ies(tilt=""), 'line 8: expected a line "TILT=NONE" before the numbers, found none; is it an IES file?'),
    ("TILT=NONE", "line 1: expected the number of lamps, got the end of the file; it is cut off"),
    (ies(kind=3), "line 5: expected photometry of type 1 (C) or 2 (B), got 3 (A), for headlights; convert the "
        "file"),
    (ies(multiplier=0), "line 5: expected a multiplier of candela above 0, got 0"),
    (ies(multiplier="x"), 'line 5: expected the multiplier of candela, a number from 0 to 1e+09, got "x"'),
    (ies(DOWN[:1]), 'line 5: expected the number of vertical angles, a number from 2 to 4000, got "1"'),
    (ies([0, 30, 30, 90]), "line 7: expected a vertical angle beyond 30, the one before, got 30"),
    (
        ies([0, 30, 60]),
        "line 7: expected vertical angles from 0 or 90 to 90 or 180, got 0 to 60; where it is dark, "
        "give them 0 candela",
    ),
    (ies(DOWN, [0, 45]), "line 8: expected horizontal angles from 0 to 0, 90, 180 or 360, or from 90 to 270, "
        "got 0 to 45"),
    (
        ies([0, 90], [0, 90, 120], kind=2),
        "line 8: expected two or more horizontal angles from -90 or 0 to 90, for type B, got 0 to 120",
    ),
    (ies(candela=[[0, 0, 0, 0]]), "line 9: expected a lamp that shines, got candela of 0 only"),
    (ies(candela=[[1, 2, -3, 0]]), 'line 9: expected candela value 3 of 4, a number from 0 to 1e+12, got "-3"'),
    (ies(candela=[[1, 2, 3]]), "line 9: expected candela value 4 of 4, got the end of the file; it is cut off"),
    (
        ies(candela=[[1, 2, 3, 4, 5]]),
        'line 9: expected the end of the file after candela value 4, got "5"; check the numbers of angles',
    ),
    (ies(factors="0 1 50"), "line 6: expected ballast factors above 0, got 0"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "wanted"), BROKEN)
def test_a_broken_file_is_one_message_with_its_line(text: str | bytes, wanted: str, tmp_path: Path) -> None:
    with pytest.raises(RowFileError) as caught:
        read_photometry(written(tmp_path, text))
    assert caught.value.args == (wanted,)


def test_a_missing_file_is_said(tmp_path: Path) -> None:
    assert problems(tmp_path, LAMP | {"ies": "no.ies"}) == ['light.sources[0].ies: "no.ies": no such file']


WORDS = ("x", "-1e9", "nan", "inf", "1e999", "--3", "0x10", "1_000", "5.5.5", "\u0665")


@pytest.mark.parametrize("seed", range(150))
def test_any_damage_is_read_or_refused_with_its_line(seed: int, tmp_path: Path) -> None:
    """A number becomes another word, or goes, or the file is cut off in the middle: each is one message."""
    random = Random(seed)
    text = LONG if seed % 2 else ies(tilt=TILT)
    head, numbers = text[: text.index("TILT=")], text[text.index("TILT=") :]
    words = list(re.finditer(r"[-\d.]+", numbers))
    at = words[random.randrange(len(words))]
    match seed % 3:
        case 0:
            broken = numbers[: at.start()] + random.choice(WORDS) + numbers[at.end() :]
        case 1:
            broken = numbers[: at.start()] + numbers[at.end() :]
        case _:
            broken = numbers[: at.start()] + "\n"
    (tmp_path / "lamp.ies").write_text(head + broken, encoding="utf-8")
    (found,) = problems(tmp_path, LAMP | {"ies": "lamp.ies"})
    assert re.fullmatch(r'light\.sources\[0\]\.ies: "lamp\.ies": line \d+: expected .*, (got|found) .+', found), found


def test_a_lamp_of_a_file_needs_no_intensity_and_may_be_turned(tmp_path: Path) -> None:
    written(tmp_path, ies())
    key = {"frame": 0, "position": [0.0, 1.0, 0.0], "up": [1.0, 0.0, 0.0]}
    job = read_lit(tmp_path, {"type": "point", "ies": "lamp.ies", "keys": [key]})
    assert job.light.sources[0].ies == tmp_path / "lamp.ies"  # type: ignore[union-attr]  # it is a point
    assert Job.model_validate(job_table(job)) == job
    spot = {"type": "spot", "ies": "lamp.ies", "keys": [key | {"target": [0.0, 0.0, 0.0]}]}
    job = read_lit(tmp_path, spot)
    assert Job.model_validate(job_table(job)) == job
    (tmp_path / "places.csv").write_text("x,y,z\n0,1,0\n0,1,1\n")
    job = read_lit(tmp_path, {"type": "point", "ies": "lamp.ies", "file": "places.csv"})
    assert len(job.light.sources[0].keys) == 2


def test_what_does_not_go_with_a_file_is_refused(tmp_path: Path) -> None:
    written(tmp_path, ies())
    key = {"frame": 0, "position": [0.0, 1.0, 0.0]}
    assert problems(tmp_path, {"type": "point", "keys": [key]}) == [
        "light.sources[0].keys[0].intensity: missing; expected a number or 3 numbers of at least 0"
    ]
    assert problems(tmp_path, {"type": "point", "keys": [key | {"intensity": 1.0, "up": [1, 0, 0]}]}) == [
        "light.sources[0].keys[0].up: expected it only next to `ies`, as other lamps look the same from "
        "all sides of their axis"
    ]
    spot = {"type": "spot", "ies": "lamp.ies", "keys": [key | {"direction": [0, -1, 0], "outer": 20.0}]}
    assert problems(tmp_path, spot) == [
        "light.sources[0].keys[0].outer: expected none next to `ies`, as the file has the intensity by direction"
    ]
    some = [key | {"intensity": 1.0}, key | {"frame": 3}]
    assert problems(tmp_path, LAMP | {"ies": "lamp.ies", "keys": some}) == [
        "light.sources[0].keys[1].intensity: missing; keys[0] gives it, so every key of this list must"
    ]
    lux = LAMP | {"ies": "lamp.ies", "units": "lux"}
    assert problems(tmp_path, lux) == ['light.sources[0].units: expected "W/sr", "cd" or "lm", got "lux"']
