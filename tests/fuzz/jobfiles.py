"""Broken and extreme job files."""

import os
from collections.abc import Iterator
from functools import partial
from itertools import count
from pathlib import Path
from random import Random
from typing import Any

import tomli_w

from framearray_cli.job.job import job_schema

from . import extremes, jobseeds
from .case import Case
from .rendered import done, render_small
from .tables import mutated
from .texts import mutated_bytes

# Shares of cases: tables changed, bytes changed, jobs at the ends of what is allowed, files that are no files.
SHARES = {"table": 0.6, "text": 0.2, "extreme": 0.18, "file": 0.02}


def cases(rng: Random, folder: Path) -> Iterator[Case]:
    """Job files of all kinds, for ever; one in ten goes to `check`, the others are rendered where they are small."""
    scene = str(jobseeds.with_scene(folder))
    tables, texts, schema = jobseeds.tables(scene), jobseeds.texts(scene), job_schema()
    for k in count():
        own = folder / f"{k:06d}"
        own.mkdir()
        job: Path = own / "job.toml"
        kind = rng.choices(list(SHARES), list(SHARES.values()))[0]
        match kind:
            case "table":
                name, table = mutated(rng, rng.choice(list(tables.values())), schema)
                job.write_bytes(toml(table))
            case "text":
                name, data = mutated_bytes(rng, rng.choice(texts).encode())
                job.write_bytes(data)
            case "extreme":
                name, table = extremes.extreme(rng, tables)
                job.write_bytes(toml(table))
            case _:
                name, job = _no_file(rng, own)
        command = "check" if rng.random() < 0.1 else "render"
        arguments = (command, job) if command == "check" else (command, job, "--quiet")
        yield Case(
            arguments=arguments,
            mutation=f"{kind}: {name}",
            folder=own,
            before=render_small(own),
            isolated=False,
            accepted=partial(done, own),
        )


def toml(table: dict[str, Any]) -> bytes:
    """A table as a file; what UTF-8 cannot say becomes a question mark."""
    return tomli_w.dumps(table).encode("utf-8", "replace")


def _no_file(rng: Random, own: Path) -> tuple[str, Path]:
    """Something that stands where a job file should; no pipe, which may wait for ever as pipes do."""
    job = own / "job.toml"
    match rng.randrange(9):
        case 0:
            job.mkdir()
            return "a folder", job
        case 1:
            return "none there", job
        case 2:
            return "a device", Path(
                rng.choice(("/dev/zero", "/dev/null", "/dev/urandom", "/dev/full", "/proc/self/mem"))
            )
        case 3:
            job.symlink_to(job)
            return "a link to itself", job
        case 4:
            job.symlink_to("/nowhere/job.toml")
            return "a broken link", job
        case 5:
            with job.open("wb") as file:
                file.truncate(1 << 40)
            return "a terabyte of zeros", job
        case 6:
            return "a name that is too long", own / ("x" * 300 + ".toml")
        case 7:
            place = Path(os.fsdecode(bytes(own) + b"/\xff\xfe.toml"))
            place.write_text("x = 1")
            return "a name that is no text", place
    return "a name with a line in it", own / "a\nb\x1b[0m.toml"
