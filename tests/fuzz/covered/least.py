"""The least files of a corpus that run the same lines of the program as all of them."""

import logging
import sys
import tempfile
import warnings
from contextlib import suppress
from pathlib import Path
from types import FrameType
from typing import Any

import framearray_cli

from .readers import REFUSED, Reader, prepared

PACKAGE = str(Path(framearray_cli.__file__).parent)
Line = tuple[str, int]


def least_of(reader: Reader, corpus: Path) -> list[Path]:
    """Small files first: each that runs a line which none before has run."""
    reached: set[Line] = set()
    kept = []
    logging.disable()
    with tempfile.TemporaryDirectory(prefix="fuzz-") as scratch, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        place = prepared(reader, Path(scratch))
        for file in sorted(corpus.iterdir(), key=lambda file: (file.stat().st_size, file.name)):
            place.write_bytes(file.read_bytes())
            if not (lines := _lines(reader, place)) <= reached:
                reached |= lines
                kept.append(file)
    logging.disable(logging.NOTSET)
    return kept


def _lines(reader: Reader, place: Path) -> set[Line]:
    """Lines of the program that reading a file runs."""
    lines: set[Line] = set()

    def inside(frame: FrameType, event: str, _: object) -> Any:
        lines.add((frame.f_code.co_filename, frame.f_lineno))
        return inside

    def trace(frame: FrameType, event: str, _: object) -> Any:
        return inside if frame.f_code.co_filename.startswith(PACKAGE) else None

    sys.settrace(trace)
    try:
        with suppress(*REFUSED):  # it is the lines that count
            reader.read(place)
    finally:
        sys.settrace(None)
    return lines
