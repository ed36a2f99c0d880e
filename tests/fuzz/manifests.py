"""Broken manifests, and broken images under a right one."""

import os
import tomllib
from collections.abc import Iterator
from functools import partial
from itertools import count
from pathlib import Path
from random import Random

from support.scenes import made_png

from framearray_cli.array.manifest import FILE_NAME

from .case import Case
from .fuzzarrays import any_command, copy_of, make_arrays, replace, secrets_lost, with_secrets
from .jobfiles import toml
from .tables import mutated, places, put
from .texts import mutated_bytes

SHARES = {"table": 0.45, "text": 0.15, "path": 0.2, "image": 0.2}
# File patterns that lead elsewhere, or do more than number files.
OUTSIDE = (
    "../outside/secret.txt", "../outside/c{camera:04d}.exr", "/etc/hostname", "/dev/zero", "/dev/stdin", "..",
    "../..", "",
    ".", "/", "a/../../outside/secret.txt", "outside/../../outside/c{camera:04d}.exr", "link/c{camera:04d}.exr",
    "link/secret.txt", "{camera.__class__}", "{camera!r}", "{camera:>1000000000}d", "{camera:0999999999d}", "{0}", "{",
    "{camera:04d}.l{light:03d}.exr", "C:\\x.exr", "..\\outside\\secret.txt", "x\0.exr", "x" * 300 + "{camera:d}.exr",
    "{light:d}.png",
    "{camera:04d}.{light:04d}.png", "manifest.toml", "records", "~/x.exr", "\\\\host\\share", "file:///etc/hostname",
)  # fmt: skip
LARGEST = 4 << 20  # bytes of a manifest; a larger one may be right, and takes seconds to read
PATTERNS = ("images", "layers", "ambient_images", "background_images")


def cases(rng: Random, folder: Path) -> Iterator[Case]:
    """Arrays of which something is broken, for ever, and any command that reads them; a third are rendered further."""
    arrays = make_arrays(folder)
    for k in count():
        own = folder / f"{k:06d}"
        name = rng.choice(list(arrays))
        array = copy_of(arrays[name], own / "array")
        with_secrets(own)
        manifest = array / FILE_NAME
        data = manifest.read_bytes()
        kind = rng.choices(list(SHARES), list(SHARES.values()))[0]
        match kind:
            case "table":
                what, table = mutated(rng, tomllib.loads(data.decode()), {})
                replace(manifest, toml(table))
            case "text":
                what, changed = mutated_bytes(rng, data)
                replace(manifest, changed[:LARGEST])
            case "path":
                what = _leading_out(rng, array, data)
            case _:
                what = _broken_image(rng, array)
        arguments = any_command(rng, array)
        if "rendered" in name or "lit" in name:
            job = folder / ("walk.toml" if name == "rendered" else "groups.toml")
            arguments = rng.choice(
                (
                    arguments,
                    ("render", job, "-o", array, "-q"),
                    ("render", job, "-o", array, "-q", "--restart"),
                    ("check", job, "-o", array),
                    ("verify", array, "--repair", "-q"),
                )
            )
        yield Case(
            arguments=arguments,
            mutation=f"{kind}: {what}",
            folder=own,
            before=partial(os.chdir, own),
            wrong=lambda outcome, own=own: secrets_lost(own),
        )


def _leading_out(rng: Random, array: Path, data: bytes) -> str:
    """A file pattern leads out of the folder, or is no pattern."""
    table = tomllib.loads(data.decode())
    (array / "link").symlink_to("../outside")
    homes = [place for place in places(table) if place[-1] in PATTERNS]
    if homes:
        put(table, rng.choice(homes), rng.choice(OUTSIDE))
    if rng.random() < 0.2:
        table[rng.choice(PATTERNS)] = rng.choice(OUTSIDE)
    replace(array / FILE_NAME, toml(table))
    return "file names"


def _broken_image(rng: Random, array: Path) -> str:
    """An image is damaged, missing, another one, or no file."""
    images = sorted(file for file in array.iterdir() if file.suffix in (".png", ".exr"))
    file = rng.choice(images)
    match rng.randrange(9):
        case 0 | 1 | 2:
            what, data = mutated_bytes(rng, file.read_bytes(), large=0.02)
            replace(file, data)
            return f"bytes: {what}"
        case 3:
            file.unlink()
            return "missing"
        case 4:
            file.unlink()
            file.mkdir()
            return "a folder in its place"
        case 5:
            file.unlink()
            file.symlink_to(
                rng.choice(("/dev/zero", "/dev/null", "../outside/secret.txt", "nowhere", file.name, "/etc"))
            )
            return "a link in its place"
        case 6:
            size = rng.choice(((1, 1), (60_000, 60_000), (2**31 - 1, 2**31 - 1), (0, 0), (8, 6)))
            replace(file, made_png(*size, bytes(1000)))
            return "a PNG of another size"
        case 7:
            replace(file, rng.choice(images).read_bytes())
            return "another image"
    file.unlink()
    with file.open("wb") as opened:
        opened.truncate(1 << 36)
    return "gigabytes of zeros"
