"""Numbers as images store them: float32 or halves, and from rows of lights to columns of pixels.

Each `_..._of` types one function of kernels, and generates its LLVM code.
"""

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from ..processor import converts_halves
from .access import is_array, place_of
from .lanes import LANES, WORD, Lanes

_LARGEST_HALF = 0x477FE000  # 65504 as the bits of a float32
# What the two results of a step of `_exchanged` take from two vectors: each step is one instruction of AVX.
_NUMBERS = [0, 8, 1, 9, 4, 12, 5, 13], [2, 10, 3, 11, 6, 14, 7, 15]
_PAIRS = [0, 1, 8, 9, 4, 5, 12, 13], [2, 3, 10, 11, 6, 7, 14, 15]
_HALVES = [0, 1, 2, 3, 8, 9, 10, 11], [4, 5, 6, 7, 12, 13, 14, 15]
TILE = 8  # rows and columns that are exchanged in registers at once: sixteen would not fit with AVX2


def _halves(builder: Any, value: Any) -> Any:
    """The bits of halves, rounded to nearest, ties to even; numbers beyond the largest half become the largest."""
    n = value.type.count
    kind, reals, short = ir.VectorType(WORD, n), value.type, ir.VectorType(ir.IntType(16), n)

    def number(x: int) -> Any:
        return ir.Constant(kind, [x] * n)

    # split off the sign, and cut the size to the largest half
    bits = builder.bitcast(value, kind)
    sign = builder.and_(bits, number(-(1 << 31)))
    size = builder.xor(bits, sign)
    size = builder.select(builder.icmp_signed("<", size, number(_LARGEST_HALF)), size, number(_LARGEST_HALF))
    if converts_halves():
        cut = builder.bitcast(builder.or_(size, sign), reals)
        return builder.bitcast(builder.fptrunc(cut, ir.VectorType(ir.HalfType(), n)), short)
    # subnormal halves: next to this number a step of float32 is the smallest half, so adding it rounds
    coarse = number((127 - 15 + 23 - 10 + 1) << 23)
    small = builder.fadd(builder.bitcast(size, reals), builder.bitcast(coarse, reals))
    small = builder.sub(builder.bitcast(small, kind), coarse)
    # normal halves: change the bias of the exponent, and drop 13 bits, rounding to even
    odd = builder.and_(builder.lshr(size, number(13)), number(1))
    normal = builder.add(builder.add(size, number(((15 - 127) << 23) + 0xFFF)), odd)
    normal = builder.lshr(normal, number(13))
    # 2^-14 is the smallest normal half
    half = builder.select(builder.icmp_signed("<", size, number(113 << 23)), small, normal)
    return builder.trunc(builder.or_(half, builder.lshr(sign, number(16))), short)


def _stored_of(typingctx: Any, array: Any, value: Any) -> Any:
    """Convert float32 numbers to what an array stores: themselves, or for uint16 the bits of halves."""
    if not isinstance(array, types.Array) or value != Lanes(types.float32):
        return None
    if array.dtype == types.float32:
        return value(array, value), lambda context, builder, sig, args: args[1]
    return Lanes(types.uint16)(array, value), lambda context, builder, sig, args: _halves(builder, args[1])


def _store_columns_of(
    typingctx: Any, rows: Any, first: Any, stride: Any, n: Any, array: Any, to: Any, step: Any
) -> Any:
    """Store the first n columns of sixteen rows of sixteen float32 numbers, each column as sixteen numbers in a row.

    Row r starts at first + r stride of a contiguous array, column k is stored from to + k step of another one, as that
    array stores numbers; see `stored`.
    """
    if not is_array(rows) or rows.dtype != types.float32 or not is_array(array):
        return None
    if array.dtype not in (types.float32, types.uint16):
        return None

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        word = types.intp
        start, width, count, goal, leap = (context.cast(builder, args[k], sig.args[k], word) for k in (1, 2, 3, 5, 6))
        source = ir.VectorType(ir.FloatType(), TILE).as_pointer()
        for top in range(0, LANES, TILE):
            for left in range(0, LANES, TILE):
                tile = []
                for r in range(TILE):
                    at = builder.add(start, builder.mul(width, width.type(top + r)))
                    place = place_of(context, builder, sig.args[0], args[0], word, builder.add(at, at.type(left)))
                    tile.append(builder.load(builder.bitcast(place, source), align=4))
                for k, column in enumerate(_exchanged(builder, tile)):
                    with builder.if_then(builder.icmp_signed(">", count, count.type(left + k)), likely=True):
                        value = column if sig.args[4].dtype == types.float32 else _halves(builder, column)
                        at = builder.add(goal, builder.mul(leap, leap.type(left + k)))
                        place = place_of(context, builder, sig.args[4], args[4], word, builder.add(at, at.type(top)))
                        builder.store(value, builder.bitcast(place, value.type.as_pointer()), align=2)
        return context.get_dummy_value()

    return types.void(rows, first, stride, n, array, to, step), codegen


def _exchanged(builder: Any, rows: list[Any]) -> list[Any]:
    """The columns of eight vectors of eight numbers."""

    def pairs(a: Any, b: Any, orders: tuple[list[int], list[int]]) -> list[Any]:
        return [builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(WORD, TILE), order)) for order in orders]

    # neighbour rows exchange single numbers, then pairs of rows pairs of numbers, then halves of four
    ones = [column for k in (0, 2, 4, 6) for column in pairs(rows[k], rows[k + 1], _NUMBERS)]
    twos = [column for k in (0, 1, 4, 5) for column in pairs(ones[k], ones[k + 2], _PAIRS)]
    fours = [pairs(twos[k], twos[k + 4], _HALVES) for k in range(4)]
    return [low for low, _ in fours] + [high for _, high in fours]


stored: Any = intrinsic(_stored_of)
store_columns: Any = intrinsic(_store_columns_of)
