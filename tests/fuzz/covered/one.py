"""One process of libFuzzer: `python -m fuzz.covered.one KIND CORPUS FOUND OPTIONS...`.

An exception that is no refusal is written down, once per place where it was raised, and the run goes on. What stops the
process, such as a crash, a hang or too much memory, libFuzzer itself writes down.
"""

import hashlib
import logging
import os
import sys
import tempfile
import traceback
import warnings
from pathlib import Path
from random import Random

import atheris

with atheris.instrument_imports(include=["framearray_cli"]):
    from .readers import READERS, REFUSED, Read, prepared


def main() -> None:
    """Fuzz one kind for as long as the options say; `RUNS` below FOUND gets a line of figures from libFuzzer."""
    name, corpus, found, *options = sys.argv[1:]
    reader = READERS[name]
    warnings.simplefilter("error")  # a warning of a library is a finding, too
    logging.disable()
    with tempfile.TemporaryDirectory(prefix="fuzz-") as scratch:
        file = prepared(reader, Path(scratch))

        def mutated(data: bytes, largest: int, seed: int) -> bytes:
            rng = Random(seed)
            if rng.random() < 0.5:
                return atheris.Mutate(data, largest)
            return reader.mutate(rng, data)[:largest]

        def one(data: bytes) -> None:
            file.write_bytes(data)
            attempt(reader.read, file, data, Path(found))

        arguments = [sys.argv[0], f"-artifact_prefix={found}{os.sep}", *options, corpus]
        atheris.Setup(arguments, one, custom_mutator=mutated)
        atheris.Fuzz()


def attempt(read: Read, file: Path, data: bytes, found: Path) -> None:
    """Read a file; keep its bytes and the traceback if it ends otherwise than it may."""
    try:
        read(file)
    except REFUSED:
        return
    except Exception as error:
        frames = traceback.extract_tb(error.__traceback__)
        place = f"{type(error).__name__} {frames[-1].filename}:{frames[-1].lineno}"
        name = hashlib.sha256(place.encode()).hexdigest()[:12]
        if not (found / f"{name}.txt").exists():
            (found / f"{name}.bin").write_bytes(data)
            (found / f"{name}.txt").write_text(traceback.format_exc(), errors="backslashreplace")


if __name__ == "__main__":
    main()
