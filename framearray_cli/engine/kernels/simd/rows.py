"""Rows of ray packets: one component of sixteen rays, wherever packets of the width of this machine have it.

Packets are arrays of (n, rows, width) float32 or int32, in the layout that Embree reads; sixteen rays are one packet of
16, two of 8 or four of 4 that follow each other. Each `..._of` types one function of kernels, and generates its LLVM
code, for the width that `packet_width` returns when it compiles.
"""

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from ...embree.library import packet_width
from .types import ELEMENTS, LANES, WORD, Lanes, takes


def _are_packets(packets: Any) -> bool:
    kind = isinstance(packets, types.Array) and packets.layout == "C" and packets.ndim == 3
    return kind and packets.dtype in (types.float32, types.int32) and packets.dtype in ELEMENTS


def _width_of(typingctx: Any) -> Any:
    """The number of rays per packet, a constant."""

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return context.get_constant(types.intp, packet_width())

    return types.intp(), codegen


def _pieces(context: Any, builder: Any, sig: Any, args: Any) -> list[Any]:
    """Pointers to the numbers of a row in each packet of sixteen rays, as vectors of the width of a packet."""
    array = context.make_array(sig.args[0])(context, builder, args[0])
    word, width = ir.IntType(64), packet_width()
    rows = builder.extract_value(array.shape, 1)
    first, row = (context.cast(builder, args[k], sig.args[k], types.intp) for k in (1, 2))
    start = builder.add(builder.mul(first, rows), builder.mul(row, word(width)))
    step = builder.mul(rows, word(width))
    piece = ir.VectorType(array.data.type.pointee, width).as_pointer()
    places = []
    for _ in range(LANES // width):
        places.append(builder.bitcast(builder.gep(array.data, [start]), piece))
        start = builder.add(start, step)
    return places


def _load_row_of(typingctx: Any, packets: Any, first: Any, row: Any) -> Any:
    """Load a row of rays first to first + 15 of packets; `first` is a multiple of 16."""
    if not _are_packets(packets) or not isinstance(first, types.Integer) or not isinstance(row, types.Integer):
        return None

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        parts = [builder.load(place, align=4) for place in _pieces(context, builder, sig, args)]
        while len(parts) > 1:  # join neighbours
            n = parts[0].type.count
            order = ir.Constant(ir.VectorType(WORD, 2 * n), list(range(2 * n)))
            parts = [builder.shuffle_vector(a, b, order) for a, b in zip(parts[::2], parts[1::2], strict=True)]
        return parts[0]

    return Lanes(packets.dtype)(packets, first, row), codegen


def _store_row_of(typingctx: Any, packets: Any, first: Any, row: Any, value: Any) -> Any:
    """Store a row of rays first to first + 15 of packets; a single number goes to all of them."""
    if not _are_packets(packets) or not isinstance(first, types.Integer) or not isinstance(row, types.Integer):
        return None
    if not (value == Lanes(packets.dtype) or takes(Lanes(packets.dtype), value)):
        return None

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        value = context.cast(builder, args[3], sig.args[3], Lanes(sig.args[0].dtype))
        places = _pieces(context, builder, sig, args)
        n = LANES // len(places)
        for k, place in enumerate(places):
            lanes = ir.Constant(ir.VectorType(WORD, n), list(range(k * n, (k + 1) * n)))
            part = value if n == LANES else builder.shuffle_vector(value, value, lanes)
            builder.store(part, place, align=4)
        return context.get_dummy_value()

    return types.void(packets, first, row, value), codegen


width_of_packets: Any = intrinsic(_width_of)
load_row: Any = intrinsic(_load_row_of)
store_row: Any = intrinsic(_store_row_of)
