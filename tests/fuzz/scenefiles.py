"""Broken scene files: small whole ones with something wrong in them, and some that were made to do harm."""

import json
from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path
from random import Random

import numpy as np
import tomli_w
from support.scenes import glb_of, split_glb

from .case import Arguments, Case
from .hostile import HOSTILE, PICTURE
from .outcome import Outcome
from .sceneseeds import Seed, made_seeds, real_seeds
from .tables import mutated_json
from .texts import BYTES, LINES

JOB = {
    "name": "fuzz",
    "scene": {"background": [0.5, 0.5, 0.5]},
    "camera": {
        "resolution": [12, 9],
        "fov": 70.0,
        "frames": 2,
        "keys": [
            {"frame": 0, "eye": [1.0, 1.0, 5.0], "target": [0.5, 0.5, 0.0]},
            {"frame": 1, "eye": [1.2, 1.0, 5.0], "target": [0.5, 0.5, 0.0]},
        ],
    },
    "light": {
        "frames": 2,
        "sources": [
            {
                "type": "point",
                "keys": [
                    {"frame": 0, "position": [0.0, 3.0, 3.0], "intensity": [20.0, 20.0, 20.0]},
                    {"frame": 1, "position": [1.0, 3.0, 3.0], "intensity": [20.0, 20.0, 20.0]},
                ],
            }
        ],
    },
    "samples": {"hits": 1, "obscurance": 4},
    "reuse": {"n_r": 1, "weights": "balance"},
    "indirect": {"method": "obscurance"},
    "obscurance": {"range": 2.0},
    "ambient": {"paths": 32},
    "output": {"format": "exr", "layers": False},
    "render": {"threads": 1},
}
TEXTS = (".obj", ".off", ".gltf")


def cases(rng: Random, folder: Path) -> Iterator[Case]:
    """Mutated scene files, each in a folder of its own beside its job."""
    made = made_seeds(folder)
    real = list(real_seeds())
    _load_program(folder, made[0])
    (folder / "secret.png").write_bytes(PICTURE)
    for k in count():
        own = folder / f"{k:06d}"
        own.mkdir()
        if rng.random() < 0.2:
            how = rng.choice([*HOSTILE])
            mutation, files = f"made to do harm: {how}", HOSTILE[how](rng)
        else:
            seed = rng.choice(real if real and rng.random() < 0.3 else made)
            mutation, files = _mutated(rng, seed)
        yield case_of(rng, mutation, own, files)


def _load_program(folder: Path, seed: Seed) -> None:
    """Render and begin a job in this process, so that no case has to load kernels."""
    from framearray_cli.cli.main import main

    own = folder / "first"
    own.mkdir()
    first = case_of(Random(0), "", own, {"scene.glb": seed.data})
    for arguments in (
        ("render", own / "job.toml", "-o", own / "out"),
        ("init", own / "scene.glb", "-o", own / "a.toml"),
    ):
        try:
            main([*map(str, arguments), "--quiet"])
        except SystemExit as end:
            assert not end.code, f"{first.folder}: the first render ended with {end.code}"


def case_of(rng: Random, mutation: str, own: Path, files: dict[str, bytes]) -> Case:
    """Write files of a scene, itself first, and choose the command that reads them; most often `render`."""
    for name, data in files.items():
        (own / name).write_bytes(data)
    scene = next(iter(files))
    job = own / "job.toml"
    command = rng.choices(("render", "check", "init"), (8, 3, 3))[0]
    # `check` reads all that surfaces follow, and compiles none of their kernels
    kind = {"surfaces": "file"} if command == "check" else {}
    job.write_text(tomli_w.dumps({**JOB, "scene": {"file": scene, **JOB["scene"], **kind}}))
    wrong = finite(own / "out") if command == "render" else Case.wrong
    if mutation.endswith("files elsewhere"):
        wrong = refused
    if command == "init":
        arguments: Arguments = ("init", own / scene, "-o", own / "made.toml")
    else:
        arguments = (command, job, "-o", own / "out")
    return Case(arguments=arguments, mutation=mutation, folder=own, wrong=wrong)


def refused(outcome: Outcome) -> str | None:
    """The verdict on a scene that wants files elsewhere: it must be refused."""
    refused = outcome.code == 3 and "refused" in outcome.message
    return None if refused else "a file elsewhere was not refused"


def finite(out: Path) -> Callable[[Outcome], str | None]:
    """The verdict on the images: four, without negative numbers."""

    def wrong(outcome: Outcome) -> str | None:
        if outcome.verdict != "accepted":
            return "pictures of a scene that was refused" if list(out.glob("*.exr")) else None
        from framearray_cli.array.images import read_image

        images = [read_image(file) for file in sorted(out.glob("*.exr"))]
        if len(images) != 4:
            return f"{len(images)} pictures"
        good = all(np.isfinite(image).all() and (image >= 0).all() for image in images)
        return None if good else "pictures that are no numbers"

    return wrong


def _mutated(rng: Random, seed: Seed) -> tuple[str, dict[str, bytes]]:
    """The mutation, and all files of the scene."""
    files = {f"scene{seed.suffix}": seed.data, **seed.beside}
    target = rng.choice([*files, f"scene{seed.suffix}", f"scene{seed.suffix}"])
    data = files[target]
    kind = f"{seed.suffix[1:]}: " if target.startswith("scene.") else f"{seed.suffix[1:]}, {Path(target).suffix}: "
    if target.endswith((".glb", ".gltf")) and rng.random() < 0.75 and (tree := _tree(data)) is not None:
        how, text = mutated_json(rng, tree)
        files[target] = with_tree(data, text)
        return f"{kind}{how}", files
    lines = target.endswith((*TEXTS, ".mtl", ".ply", ".stl")) and rng.random() < 0.75
    how, change = rng.choice([*(LINES if lines else BYTES).items()])
    files[target] = change(rng, data)
    return f"{kind}{how}", files


def _tree(data: bytes) -> object:
    """The JSON of a glTF; None where it is broken already."""
    try:
        return split_glb(data)[0] if data[:4] == b"glTF" else json.loads(data)
    except ValueError:
        return None


def with_tree(data: bytes, text: bytes) -> bytes:
    """A glTF with another JSON."""
    return glb_of(text, split_glb(data)[1]) if data[:4] == b"glTF" else text
