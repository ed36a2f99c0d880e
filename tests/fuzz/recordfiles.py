"""Broken records of finished frames, and other things in their folder."""

import json
import os
from collections.abc import Iterator
from functools import partial
from itertools import count
from pathlib import Path
from random import Random
from typing import Any

from framearray_cli.array.record import FOLDER, seal

from .case import Arguments, Case
from .fuzzarrays import copy_of, make_arrays, replace, secrets_lost, with_secrets
from .outcome import Outcome
from .pathfiles import RANGES
from .tables import mutated
from .texts import mutated_bytes

SHARES = {"bytes": 0.35, "lines": 0.15, "seal": 0.3, "file": 0.2}
# Values that a line may have that was written by somebody who knows its checksum.
FORGED: tuple[dict[str, Any], ...] = (
    {"lights": [0, 10**12]}, {"lights": [0, 10**9]}, {"lights": [-5, 5]}, {"lights": [0]}, {"c": 10**9}, {"c": -1},
    {"c": "0"},
    {"files": {"../outside/secret.txt": [41, "0"]}}, {"files": {"/dev/zero": [0, "0"]}}, {"files": {"x\0": [1, "0"]}},
    {"files": {"x" * 300: [1, "0"]}}, {"files": {}}, {"files": []}, {"seconds": "x"}, {"seconds": []},
    {"seconds": 1e400},
    {"rays": []}, {"rays": {"native": "x"}}, {"rays": {"x": 1e300}}, {"rays": None}, {"hits": 1e400}, {"hits": None},
    {"notes": 5}, {"notes": ["x" * 10_000] * 100}, {"errors": {"x": [1, 2]}}, {"errors": {"0": [1e400, -1e400]}},
)  # fmt: skip


def cases(rng: Random, folder: Path) -> Iterator[Case]:
    """Arrays with broken records, for ever, gone on with or verified."""
    arrays = make_arrays(folder)
    for k in count():
        own = folder / f"{k:06d}"
        name, job = rng.choice((("rendered", "walk.toml"), ("lit by groups", "groups.toml")))
        array = copy_of(arrays[name], own / "array")
        with_secrets(own)
        if rng.random() < 0.5:
            rng.choice(sorted(array.glob("*.exr"))).unlink()
        kind = rng.choices(list(SHARES), list(SHARES.values()))[0]
        record = next((array / FOLDER).glob("*.jsonl"))
        what = {"bytes": _bytes, "lines": _lines, "seal": _sealed, "file": _files}[kind](rng, record)
        go_on: Arguments = ("render", folder / job, "-o", array, "-q")
        arguments = rng.choice(
            (go_on, go_on, (*go_on, "--restart"), (*go_on, "--cameras", rng.choice(RANGES)), ("verify", array, "-q"),
             ("verify", array, "--repair", "-q"))
        )  # fmt: skip
        whole = arguments == go_on and kind in ("bytes", "lines")
        yield Case(
            arguments=arguments,
            mutation=f"{kind}: {what}",
            folder=own,
            before=partial(os.chdir, own),
            wrong=partial(_wrong, own, arrays[name] if whole else None),
        )


def _wrong(own: Path, like: Path | None, outcome: Outcome) -> str | None:
    """Whether files elsewhere were touched, or a render made other images than one that was not stopped."""
    if like and outcome.code == 0:
        for file in like.glob("*.exr"):
            if (
                not (own / "array" / file.name).is_file()
                or (own / "array" / file.name).read_bytes() != file.read_bytes()
            ):
                return "other images than without a stop"
    return secrets_lost(own)


def _bytes(rng: Random, record: Path) -> str:
    what, data = mutated_bytes(rng, record.read_bytes())
    replace(record, data)
    return what


def _lines(rng: Random, record: Path) -> str:
    lines = record.read_bytes().split(b"\n")
    match rng.randrange(4):
        case 0:
            rng.shuffle(lines)
            what = "in another order"
        case 1:
            lines = [line for line in lines for _ in range(rng.choice((1, 2, 100)))]
            what = "repeated"
        case 2:
            lines = [line for line in lines if rng.random() < 0.5]
            what = "some missing"
        case _:
            lines[rng.randrange(len(lines))] = rng.choice(
                (b"{}", b"[]", b"null", b'{"c":0}', b'{"check":"0000000000000000",}')
            )
            what = "one another"
    replace(record, b"\n".join(lines))
    return what


def _sealed(rng: Random, record: Path) -> str:
    """Lines with a right checksum that say something wrong: nobody but a forger writes them."""
    tables = [json.loads(line) for line in record.read_bytes().splitlines() if line.strip()]
    for table in tables:
        table.pop("check", None)
    k = rng.randrange(len(tables))
    if rng.random() < 0.5:
        tables[k] |= rng.choice(FORGED)
        what = "a wrong value"
    else:
        _, changed = mutated(rng, tables[k], {})
        tables[k] = json.loads(json.dumps(changed, default=str))
        what = "a table changed"
    replace(record, b"\n".join(map(seal, tables)) + b"\n")
    return what


def _files(rng: Random, record: Path) -> str:
    """Other things in the folder of records."""
    folder = record.parent
    names = (
        "0-1.lock",
        "x.lock",
        "0-999999.lock",
        "9" * 200 + ".lock",
        ".guard",
        "0-1.jsonl",
        "x.jsonl",
        "0-2.jsonl",
        "a\nb.jsonl",
    )
    place = folder / rng.choice(names)
    data = record.read_bytes()
    if place.exists() or place.is_symlink():
        place.unlink()
    match rng.randrange(5):
        case 0:
            place.mkdir()
            return "a folder"
        case 1:
            place.symlink_to(rng.choice(("/dev/zero", "nowhere", place.name, "/dev/full")))
            return "a link"
        case 2:
            place.write_bytes(rng.randbytes(1000))
            return "random bytes"
        case 3:
            place.write_bytes(data)
            return "a copy of the record"
    for file in folder.iterdir():
        file.unlink()
    folder.rmdir()
    folder.write_text("no folder")
    return "a file in place of the folder"
