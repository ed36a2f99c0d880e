"""Broken job files: a small job with something wrong in it."""

from collections.abc import Iterator
from itertools import count
from pathlib import Path
from random import Random

import tiny
import tomli_w

from .case import Case


def cases(rng: Random, folder: Path) -> Iterator[Case]:
    """Job files that end too early."""
    scene = tiny.save_glb(tiny.room_meshes(), folder / "tiny.glb")
    text = tomli_w.dumps(tiny.table(scene={"file": str(scene)}))
    for k in count():
        own = folder / f"{k:06d}"
        own.mkdir()
        job = own / "job.toml"
        job.write_text(text[: rng.randrange(len(text))])
        yield Case(arguments=("check", job, "-o", own / "out"), mutation="text: cut short", folder=own)
