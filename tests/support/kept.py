"""Read the light that is kept of hits, see `framearray_cli/engine/frames/kept_light.py`."""

import ctypes
from typing import Any

import numpy as np

from framearray_cli.engine.frames.kept_light import (
    FLAGS,
    HEAD_BYTES,
    INDIRECT_LIGHT,
    PACKED,
    LightStore,
    direct_bytes,
)
from framearray_cli.engine.frames.records import ArrayPool, Column, HitRecords, StoredLight
from framearray_cli.engine.hits.row import LIT
from framearray_cli.engine.kernels.simd import LANES
from framearray_cli.engine.terms.cells.gather import LIGHT

KEPT = 2.0**-10  # the largest relative error of a number that is kept


def keep(row: Any, irradiance: Any) -> tuple[Any, LightStore]:
    """Keep irradiance (n, channels, n_lights); return the addresses, valid as long as the store."""
    _, channels, n_lights = irradiance.shape
    store, address = LightStore(ArrayPool(), StoredLight(1, channels, n_lights)), np.empty(len(row), np.int64)
    store.keep(HitRecords({"row": row, "irradiance": irradiance}), HitRecords({"row": row, "light": address}))
    return address, store


def short(values: Any) -> Any:
    """Numbers rounded to those that are kept, with ten significant bits; from 2^-66 on, below 2^61."""
    fraction, exponent = np.frexp(np.asarray(values, np.float64))
    found = np.ldexp(np.floor(1024 * fraction + 0.5), exponent - 10)
    return np.where(np.asarray(values) < 2.0**-66, 0.0, np.minimum(found, 2.0**61 - 2.0**51))


def numbers_at(address: int, n: int) -> Any:
    """The numbers that are kept at an address."""
    packed = np.ctypeslib.as_array((ctypes.c_uint16 * n).from_address(int(address)))
    return (packed.astype(np.uint32) << np.uint32(14)).view(np.float32) * np.float32(2.0**60)


def irradiance_of(records: HitRecords, light: StoredLight) -> Any:
    """E[l] of hits, (n, channels, n_lights), of at most 24 packets of light positions."""
    n_packets = -(-light.n_lights // LANES)
    found = np.zeros((len(records.row), light.channels, n_packets * LANES), np.float32)
    for i, (address, row) in enumerate(zip(records["light"].tolist(), records.row, strict=True)):
        gathered = HEAD_BYTES + direct_bytes(light) // 2 if address & INDIRECT_LIGHT else 0
        place = (address & ~FLAGS) + gathered
        for packet in range(n_packets):
            if int(row[LIT]) >> packet & 1:
                some = np.ctypeslib.as_array((ctypes.c_float * (light.channels * LANES)).from_address(place))
                found[i, :, packet * LANES : (packet + 1) * LANES] = some.reshape(light.channels, LANES)
                place += some.nbytes
    return found[:, :, : light.n_lights]


def packed(records: HitRecords, column: Column) -> Any:
    """A packed column of hits, (n, columns); zeros of hits without."""
    found = np.zeros((len(records.row), *column.shape), np.float32)
    for row, address in zip(found, records["light"].tolist(), strict=True):
        if address & PACKED:
            words = ctypes.c_int32 * len(row)
            row.view(np.int32)[:] = np.ctypeslib.as_array(words.from_address((address & ~FLAGS) - column.nbytes))
    return found


def unpacked(records: HitRecords, light: StoredLight) -> HitRecords:
    """The columns of a batch with the light that is kept, direct and indirect."""
    n_packets, indirect = -(-light.n_lights // LANES), np.zeros((len(records.row), LIGHT + light.values), np.float32)
    for row, address in zip(indirect, records["light"].tolist(), strict=True):
        if address & INDIRECT_LIGHT:
            row[:LIGHT] = np.ctypeslib.as_array((ctypes.c_float * LIGHT).from_address(address & ~FLAGS))
            packets = numbers_at((address & ~FLAGS) + HEAD_BYTES, n_packets * light.channels * LANES)
            by_channel = packets.reshape(n_packets, light.channels, LANES).swapaxes(0, 1).reshape(light.channels, -1)
            row[LIGHT:] = by_channel[:, : light.n_lights].reshape(-1)
    return HitRecords(records.arrays | {"irradiance": irradiance_of(records, light), "indirect": indirect})
