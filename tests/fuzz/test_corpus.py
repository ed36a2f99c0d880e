"""Files that once reached something new in a reader: each is still read or refused."""

import logging
from contextlib import suppress
from pathlib import Path

import pytest

from fuzz.covered.readers import READERS, REFUSED, Reader, prepared, seeds_of

NEEDS = {
    "draco": ("DracoPy",),
    "3mf": ("lxml", "networkx"),
    "mtlx": ("pxr", "MaterialX"),
    "ifc": ("ifcopenshell",),
}
CORPUS = Path(__file__).parent / "corpus"


def reader_of(kind: str) -> Reader:
    """The reader of a kind; skips the test where its library is not installed."""
    if kind.startswith("usd"):
        pytest.importorskip("pxr", reason="usd-core is not installed (extra usd)")
    for library in NEEDS.get(kind, ()):
        pytest.importorskip(library, reason="an optional library")
    return READERS[kind]


@pytest.mark.parametrize("kind", READERS)
def test_seeds_are_read(kind: str, tmp_path: Path) -> None:
    reader = reader_of(kind)
    file = prepared(reader, tmp_path)
    found = seeds_of(reader, tmp_path / "seeds")
    assert found
    for data in found:
        file.write_bytes(data)
        reader.read(file)


@pytest.mark.parametrize("kind", READERS)
def test_the_corpus_is_read_or_refused(kind: str, tmp_path: Path) -> None:
    reader = reader_of(kind)
    files = sorted((CORPUS / kind.replace(" ", "-")).iterdir())
    assert files
    logging.disable()
    try:
        place = prepared(reader, tmp_path)
        for file in files:
            place.write_bytes(file.read_bytes())
            with suppress(REFUSED):  # the corpus is of broken files; other exceptions fail
                reader.read(place)
    finally:
        logging.disable(logging.NOTSET)
