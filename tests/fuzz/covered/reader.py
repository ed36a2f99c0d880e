"""How files of a kind are read."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from .mutators import Mutate

Read = Callable[[Path], object]


@dataclass(frozen=True)
class Reader:
    """How files of a kind are read.

    Attributes:
        name: of the file that the bytes under test become.
        read: reads that file, or raises one of `REFUSED`.
        seeds: bytes of files that are read without a complaint.
        mutate: what their bytes become, beside what libFuzzer does with them.
        beside: name -> bytes of files that lie beside it.
    """

    name: str
    read: Read
    seeds: Callable[[Path], list[bytes]]
    mutate: Mutate
    beside: Callable[[], dict[str, bytes]] = dict
