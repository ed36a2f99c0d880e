"""Cryptomatte: hashes, attributes and channels."""

import json
from pathlib import Path

import numpy as np
import pytest

from framearray_cli.array.cryptomatte import attributes_of, channels_of, id_bits, ids_of, murmur3
from framearray_cli.array.images import write_layers

# From the tests of the reference implementation.
KNOWN = {
    "hello": 6.0705627102400005616e-17,
    "cube": -4.08461912519e15,
    "sphere": 2.79018604383e15,
    "plane": 3.66557617593e-11,
    "равнина": -1.3192631212399999468e-25,
    "mädchen": 6.2361298211599995797e25,
}


def test_ids_are_those_of_the_reference_implementation() -> None:
    np.testing.assert_allclose(ids_of(list(KNOWN)), np.array(list(KNOWN.values()), np.float32), rtol=1e-7)


def test_known_hashes() -> None:
    """Of MurmurHash3_x86_32 with seed 0: every length of the rest."""
    known = {b"": 0, b"\0": 0x514E28B7, b"\0\0": 0x30F4C306, b"\0\0\0": 0x85F0B427, b"\0\0\0\0": 0x2362F9DE}
    assert {data: murmur3(data) for data in known} == known


def test_every_id_is_a_normal_number() -> None:
    names = [f"object {k}" for k in range(3000)]
    bits = np.array([id_bits(name) for name in names], np.uint32)
    exponent = bits >> 23 & 255
    assert ((exponent > 0) & (exponent < 255)).all()
    changed = np.array([murmur3(name.encode()) for name in names], np.uint32) != bits
    assert 1 <= changed.sum() < 100, "one of 128 hashes is no normal number"
    np.testing.assert_array_equal(ids_of(names).view(np.uint32), bits)


def test_another_reader_finds_every_matte(tmp_path: Path) -> None:
    """By the specification only: metadata -> manifest -> id -> sum of the coverage of all ranks with that id."""
    openexr = pytest.importorskip("OpenEXR", reason="the second reader of EXR is not installed")
    rng, names = np.random.default_rng(1), ("floor", "größe", "a/b", 'say "x"', "lamp")
    number = np.sort(rng.integers(-1, 5, (7, 9, 6)).astype(np.int32), axis=-1)[..., ::-1].copy()
    coverage = np.where(number >= 0, np.sort(rng.uniform(0, 0.3, number.shape))[..., ::-1], 0).astype(np.float32)
    channels = {"depth.Z": np.ones((7, 9), np.float32), **channels_of("CryptoObject", names, number, coverage)}
    write_layers(tmp_path / "a.exr", channels, {**attributes_of("CryptoObject", names)})

    file = openexr.File(str(tmp_path / "a.exr"), separate_channels=True)
    header, pixels = file.header(), {name: channel.pixels for name, channel in file.channels().items()}
    (key,) = {name.split("/")[1] for name in header if name.startswith("cryptomatte/")}
    assert header[f"cryptomatte/{key}/hash"] == "MurmurHash3_32"
    assert header[f"cryptomatte/{key}/conversion"] == "uint32_to_float32"
    layer, manifest = header[f"cryptomatte/{key}/name"], json.loads(header[f"cryptomatte/{key}/manifest"])
    assert list(manifest) == list(names)
    for k, name in enumerate(names):
        wanted, found = np.uint32(int(manifest[name], 16)).view(np.float32), np.zeros((7, 9))
        for level in ("00", "01", "02"):
            for of_id, of_coverage in ("RG", "BA"):
                same = pixels[f"{layer}{level}.{of_id}"] == wanted
                found += np.where(same, pixels[f"{layer}{level}.{of_coverage}"], 0)
        np.testing.assert_allclose(found, np.where(number == k, coverage, 0).sum(axis=-1), rtol=1e-6)
