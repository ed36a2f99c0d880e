"""Shared by the processes of all cases: the program with its kernels, loaded before the first case."""

import gc
import importlib
import os
import pkgutil
from contextlib import suppress
from pathlib import Path

import tomli_w

import framearray_cli
from framearray_cli.cli.main import main

from . import jobseeds


def load() -> None:
    """Import every file of the program."""
    for module in pkgutil.walk_packages(framearray_cli.__path__, "framearray_cli."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)


def warm(folder: Path) -> None:
    """Import the program, and render every small job once, so that each kernel is compiled and in memory.

    A process that is copied from this one has all that; it starts its own threads.
    """
    load()
    scene = str(jobseeds.with_scene(folder))
    for name, table in jobseeds.tables(scene).items():
        for more in (
            {},
            {"obscurance": {"range": 1.0, "outside": "background"}},
        ):
            job = folder / "warm.toml"
            job.write_text(tomli_w.dumps({**table, **more}))
            try:
                main(["render", str(job), "--quiet", "--restart", "--output", str(folder / f"warm-{name}")])
            except SystemExit as end:
                assert not end.code, f"the job {name!r} is wrong"
    _refused(folder)
    gc.collect()
    gc.freeze()  # else a process that is copied looks through all that, and so copies it in memory


def _refused(folder: Path) -> None:
    """Load the modules that only messages need; discard the messages."""
    job = folder / "warm.toml"
    job.write_text("a = 1\nname = 5\n[camera]\nfov = 500\nfof = 1\nkeys = 3\n[light]\nsources = [{}, { type = 'x' }]\n")
    stderr = os.dup(2)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    try:
        for command in (
            ["check", str(job)],
            ["verify", str(folder)],
            ["assemble", str(folder), str(job), "-o", "a.gif"],
        ):
            with suppress(SystemExit):
                main(command)
    finally:
        os.dup2(stderr, 2)
        os.close(stderr)
