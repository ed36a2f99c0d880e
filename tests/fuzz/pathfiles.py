"""Broken and extreme paths of movies, and odd options of the commands that read an array."""

import os
from collections.abc import Callable, Iterator
from functools import partial
from itertools import count
from pathlib import Path
from random import Random
from typing import Any

from bench.core.results import ROOT

from framearray_cli.base.forms.schema import file_schema
from framearray_cli.tools.movie.pathfile import MoviePath

from .case import Arguments, Case
from .fuzzarrays import copy_of, make_arrays
from .jobfiles import toml
from .tables import mutated
from .texts import mutated_bytes
from .values import TEXTS

SHARES = {"table": 0.5, "text": 0.2, "option": 0.3}
MOST_FRAMES = 300  # of a movie; more are refused, instead of a million

SEGMENTS: tuple[dict[str, Any], ...] = (
    {"segments": [{"frames": 5, "camera": ["first", "last"]}]},
    {"segments": [{"frames": 3, "camera": 1, "light": [0, -1]},
    {"seconds": 0.2, "light": ["50%", "first"], "reverse": True}]},
    {
        "fps": 12,
        "positions": "blend",
        "segments": [
            {"seconds": 0.5, "light": [0, 0.5, 1], "ease": "in-out", "loops": 2, "back_and_forth": True},
            {"frames": 4, "camera": [0, 2], "hold": 0.25, "positions": "nearest", "ease": "out"},
        ],
    },
    {
        "segments": [{"frames": 6, "camera": [0, 1], "axes": {"lamp": [0, 1]}}],
        "groups": {
            "sun": {"intensity": [{"time": 0, "value": 1.0}, {"time": "50%", "value": 0.2}], "color": [1, 0.5, 0.2]},
            "lamp": {"intensity": 2.0},
            "background": {"color": [{"time": 0.1, "value": [1, 1, 0.5]}]},
        },
        "ambient": {"intensity": 0.5},
    },
)  # fmt: skip

PLACES = (
    "first", "last", "0", "-1", "1", "50%", "100%", "101%", "-0", "1.5", "1e300", "inf", "nan", "999999999",
    "9" * 400, "١٢%",
    "0,1", "all", "all,0", ",", "0,,1", "lamp=0", "light=1", "lamp=0,1", "=", "lamp=", "x=0", "0-1", "0 %",
    "1" * 100_000,
)  # fmt: skip
RANGES = (
    "0", "0-2", "2-0", "0-2x2", "0-2x0", "0-2y2", "0-2:-1", "0-2x-1", "0--1", "-1", "0-999999", "0-9999999", "1-", "",
    " ", ",",
    "0," * 30_000 + "0", "0-2x999999", "a", "0x2", "0-1-2", "٣", "0-2 ,1", "0.5", "1e3", "0-2,0-2", "0-2y1",
)  # fmt: skip
TARGETS = (
    "a.gif", "a.webp", "a.mp4", "a.MP4", "a.mov", "a.webm", "a.mkv", "a.avi", "a.####.png", "a.#.jpg", "#.exr",
    "a.####.b.##.png",
    "####", "a.png", "a.%04d.png", "a.{frame}.png", ".png", ".", "-", "", " ", "a\nb.gif", "x" * 300 + ".gif",
    "dir/sub/a.gif",
    "here", "here.gif", "array", "array/a.####.png", "array/manifest.toml", "a.tif", "a.####.tif", "a.exr", "Ω.gif",
    "a.gif/b.gif",
)  # fmt: skip
NUMBERS = (
    "0",
    "1",
    "-1",
    "0.001",
    "1e-320",
    "1e308",
    "nan",
    "inf",
    "-inf",
    "1e400",
    "0x10",
    "1_000",
    "24",
    "40000",
    "64",
    "-64",
    "",
)


def cases(rng: Random, folder: Path) -> Iterator[Case]:
    """Path files and options, for ever."""
    arrays = make_arrays(folder)
    files = [
        (ROOT / "jobs" / name).read_bytes() for name in ("easing-movie.toml", "first-movie.toml", "relight-movie.toml")
    ]
    texts, schema = [*files, *map(toml, SEGMENTS)], file_schema(MoviePath)
    for k in count():
        own = folder / f"{k:06d}"
        array = copy_of(arrays[rng.choice(("png", "exr", "groups"))], own / "array")
        path = own / "path.toml"
        kind = rng.choices(list(SHARES), list(SHARES.values()))[0]
        arguments: Arguments = ("assemble", array, path, "-o", rng.choice(("a.gif", "a.####.png")), "-q")
        match kind:
            case "table":
                name, table = mutated(rng, rng.choice(SEGMENTS), schema)
                path.write_bytes(toml(table))
            case "text":
                name, data = mutated_bytes(rng, rng.choice(texts))
                path.write_bytes(data)
            case _:
                path.write_bytes(toml(SEGMENTS[0]))
                (own / "here").mkdir()
                (own / "here.gif").mkdir()
                name, arguments = _options(rng, array, path)
        yield Case(
            arguments=arguments,
            mutation=f"{kind}: {name}",
            folder=own,
            before=partial(_within, own),
            isolated=False,
        )


def _within(own: Path) -> None:
    """Work in the folder of the case, on movies of few frames."""
    from framearray_cli.tools.movie import timeline

    os.chdir(own)
    timeline.MOST_FRAMES = MOST_FRAMES


def _options(rng: Random, array: Path, path: Path) -> tuple[str, Arguments]:
    """A command with one option that is odd."""
    place = rng.choice((*PLACES, rng.choice(TEXTS).replace("\0", "")))
    odd: dict[str, Callable[[], Arguments]] = {
        "where a movement stays": lambda: ("assemble", array, "walk", "--at", place, "-o", "a.gif"),
        "seconds": lambda: ("assemble", array, "diagonal", "--seconds", rng.choice(NUMBERS), "-o", "a.gif"),
        "frames per second": lambda: ("assemble", array, "walk", "--fps", rng.choice(NUMBERS), "-o", "a.gif"),
        "exposure": lambda: ("assemble", array, "walk", "--exposure", rng.choice(NUMBERS), "-o", "a.gif"),
        "view": lambda: ("assemble", array, "walk", "--view", rng.choice(TEXTS).replace("\0", ""), "-o", "a.gif"),
        "file to write": lambda: ("assemble", array, rng.choice((path, "walk")), "-o", rng.choice(TARGETS)),
        "cameras of an export": lambda: ("export", array, "-f", "cinema", "--cameras", place, "-o", "e"),
        "lights of an export": lambda: ("export", array, "-f", "nerfstudio", "--light", place, "-o", "e"),
        "axes of an export": lambda: ("export", array, "-f", "colmap", "--at", place, "-o", "e"),
        "points of an export": lambda: ("export", array, "-f", "colmap", "--points", rng.choice(NUMBERS), "-o", "e"),
        "folder of an export": lambda: ("export", array, "-f", "cinema", "-o", rng.choice(TARGETS)),
        "sheet": lambda: ("sheet", array, "-o", rng.choice(TARGETS), "--columns", rng.choice(NUMBERS)),
        "axes of a sheet": lambda: ("sheet", array, "-o", "s.png", "--side", place, "--at", rng.choice(PLACES)),
        "width of a sheet": lambda: ("sheet", array, "-o", "s.png", "--width", rng.choice(NUMBERS)),
        "folder of a page": lambda: ("view", array, "--export", rng.choice(TARGETS)),
        "cache of a page": lambda: ("view", array, "--cache", rng.choice(TARGETS), "--export", "page"),
        "array": lambda: ("verify", rng.choice((path, array / "manifest.toml", array / "x", "", "-", path / "x"))),
    }  # fmt: skip
    name = rng.choice(list(odd))
    return name, odd[name]()
