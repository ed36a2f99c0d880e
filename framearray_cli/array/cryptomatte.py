"""Cryptomatte: ranked pairs of an object's hashed name and its coverage, as channels of an EXR.

After the Cryptomatte specification 1.2.0: names are hashed with MurmurHash3, 32 bits, of their UTF-8; the bits make
a float, with another exponent if it would be no number; a manifest in the header lists all names.
"""

import json
from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np

from framearray_cli.base.arrays import Float32, Int32

MASK = 0xFFFFFFFF
# Multipliers and additions of MurmurHash3 for 32 bits.
_C1, _C2, _STEP, _END_1, _END_2 = 0xCC9E2D51, 0x1B873593, 0xE6546B64, 0x85EBCA6B, 0xC2B2AE35
_EXPONENT, _NO_EXPONENTS = 23, (0, 255)  # place of a float's exponent; exponents of denormals, and of infinity and NaN
_KEY_DIGITS = 7  # of the hash of a layer's name, in names of attributes
LAYERS = {"object": "CryptoObject", "material": "CryptoMaterial"}  # names of layers, as other programs write them
PREFIX = "Crypto"
ATTRIBUTES = "cryptomatte/"  # begins the names of attributes
LETTERS = "RGBA"  # of a channel group, which holds two ranks: id, coverage, id, coverage


def murmur3(data: bytes) -> int:
    """Return the hash of MurmurHash3_x86_32 with seed 0."""
    h = 0
    whole = len(data) // 4 * 4
    for at in range(0, whole, 4):
        h ^= _mixed(int.from_bytes(data[at : at + 4], "little"))
        h = (_rotated(h, 13) * 5 + _STEP) & MASK
    if data[whole:]:
        h ^= _mixed(int.from_bytes(data[whole:], "little"))
    h ^= len(data)
    h = (h ^ h >> 16) * _END_1 & MASK
    h = (h ^ h >> 13) * _END_2 & MASK
    return h ^ h >> 16


def _mixed(word: int) -> int:
    return _rotated(word * _C1 & MASK, 15) * _C2 & MASK


def _rotated(word: int, bits: int) -> int:
    return (word << bits | word >> 32 - bits) & MASK


def id_bits(name: str) -> int:
    """Return the bits of the id of a name: its hash, with an exponent that every program reads back unchanged."""
    found = murmur3(name.encode())
    return found ^ 1 << _EXPONENT if found >> _EXPONENT & 0xFF in _NO_EXPONENTS else found


def ids_of(names: Sequence[str]) -> Float32:
    """Return the ids of names, (n,) float32."""
    return np.array([id_bits(name) for name in names], np.uint32).view(np.float32)


@lru_cache(maxsize=8)
def _described(layer: str, names: tuple[str, ...]) -> tuple[Mapping[str, str], Float32]:
    """Return the attributes of a layer, and the ids of its names; the last is 0, for none."""
    key = ATTRIBUTES + f"{murmur3(layer.encode()):08x}"[:_KEY_DIGITS]
    manifest = {name: f"{id_bits(name):08x}" for name in names}
    attributes = {
        f"{key}/name": layer,
        f"{key}/hash": "MurmurHash3_32",
        f"{key}/conversion": "uint32_to_float32",
        f"{key}/manifest": json.dumps(manifest, ensure_ascii=False, separators=(",", ":")),
    }
    return attributes, np.append(ids_of(names), np.float32(0))


def attributes_of(layer: str, names: Sequence[str]) -> Mapping[str, str]:
    """Return the attributes that describe a layer, and name all of its objects."""
    return _described(layer, tuple(names))[0]


def channels_of(layer: str, names: Sequence[str], number: Int32, coverage: Float32) -> dict[str, Float32]:
    """Return the channels of a layer, name -> (h, w): `CryptoObject00.R` the first id, `.G` its coverage, and so on.

    Args:
        number: (h, w, ranks) indices of names, -1 for none; an even number of ranks.
        coverage: (h, w, ranks) share of the pixel.
    """
    ids = _described(layer, tuple(names))[1][number]
    channels = {}
    for rank in range(number.shape[-1]):
        group, at = f"{layer}{rank // 2:02d}", rank % 2 * 2
        channels[f"{group}.{LETTERS[at]}"] = ids[..., rank]
        channels[f"{group}.{LETTERS[at + 1]}"] = coverage[..., rank]
    return channels
