"""Small frame arrays to be broken, and copies of them."""

import os
from pathlib import Path
from random import Random

import numpy as np
import tomli_w
from support import movies, tiny

from framearray_cli.job.read import read_job
from framearray_cli.render.render import render

from . import jobseeds

SECRET = "nobody but its owner may change this file"


def small(c: int, l: int) -> np.ndarray:
    """A picture that differs by camera and light."""
    y, x = np.mgrid[0:6, 0:8].astype(np.float32)
    return np.stack([x / 8, y / 6, np.full_like(x, (c + 3 * l) / 20)], axis=-1)


def make_arrays(folder: Path) -> dict[str, Path]:
    """Arrays by name: PNG and EXR images without layers, groups, and two that were rendered with layers and records."""
    places = {name: folder / "arrays" / name for name in ("png", "exr", "groups", "rendered", "lit by groups")}
    for place in places.values():
        place.mkdir(parents=True)
    movies.plain(places["png"], 3, 2, "png", small)
    movies.plain(places["exr"], 3, 2, "exr", small)
    movies.grouped(places["groups"], 2)
    scene = str(jobseeds.with_scene(folder))
    jobs = jobseeds.tables(scene)
    for name, job in (("rendered", "walk"), ("lit by groups", "groups")):
        table = jobs[job]
        table["output"] = {**table["output"], "directory": str(places[name])}
        first, last = (dict(key) for key in tiny.WALK["keys"])
        table["camera"] = {**table["camera"], "frames": 3, "keys": [first, {**last, "frame": 2}]}
        file = folder / f"{job}.toml"
        file.write_text(tomli_w.dumps(table))
        render(read_job(file))
    return places


def copy_of(array: Path, place: Path) -> Path:
    """A copy whose files are links: what is changed must be replaced, not written to."""
    for folder, _, files in os.walk(array):
        here = place / Path(folder).relative_to(array)
        here.mkdir(parents=True)
        for name in files:
            os.link(Path(folder) / name, here / name)
    return place


def replace(file: Path, data: bytes) -> None:
    """Another file in the place of one that is linked."""
    file.unlink()
    file.write_bytes(data)


def with_secrets(own: Path) -> None:
    """Files beside an array that no command may touch."""
    for place in (own / "outside", own / "outside" / "deep"):
        place.mkdir()
        for name in ("secret.txt", "manifest.toml.bak", "c0000.exr"):
            (place / name).write_text(SECRET)


def secrets_lost(own: Path) -> str | None:
    """The damage to them, or None."""
    files = sorted((own / "outside").rglob("*"))
    texts = [file.read_bytes().decode(errors="replace") for file in files if file.is_file()]
    return None if texts == [SECRET] * 6 and len(files) == 7 else "changed a file outside of its folder"


def any_command(rng: Random, array: Path) -> tuple[str | Path, ...]:
    """Any command that reads an array; what it writes lies in the working directory."""
    return rng.choice(
        (
            ("assemble", array, "walk", "-o", rng.choice(("walk.gif", "walk.webp", "walk.####.png")), "-q"),
            ("assemble", array, "light", "-o", "light.gif", "--label", "--exposure", "1", "-q"),
            (
                "assemble",
                array,
                "diagonal",
                "-o",
                rng.choice(("both.mp4", "both.####.exr", "frames")),
                "--blend",
                "-q",
            ),
            ("sheet", array, "-o", rng.choice(("sheet.png", "sheet.exr")), "-q"),
            ("export", array, "-f", "nerfstudio", "-o", "nerf", "-q"),
            ("export", array, "-f", "colmap", "-o", "colmap", "--light", "all", "-q"),
            ("export", array, "-f", "cinema", "-o", "cinema", "-q"),
            ("view", array, "--export", "page", "-q"),
            ("verify", array, "-q"),
        )
    )
