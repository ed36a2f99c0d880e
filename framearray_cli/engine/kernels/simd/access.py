"""Load sixteen numbers and store them: from arrays, contiguous, in rows of three, or at any offsets; from ray packets.

Offsets count elements of the flat array; nothing checks them. Each `intrinsic` types one function of kernels, and
generates its LLVM code.

Flagged lanes are appended to a queue at the cost of the numbers behind its end. Only processors with AVX-512 have an
instruction that moves flagged numbers next to each other. With AVX2 eight numbers are permuted at once, by a table of
all 256 patterns of flags.

Packets are arrays of (n, rows, width) float32 or int32, in the layout that Embree reads; sixteen rays are one packet of
16, two of 8 or four of 4 that follow each other. The width is that which `packet_width` returns at compile time.

Images store float32 or halves. Rows of lights become columns of pixels tile by tile, in registers.
"""

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from ...embree.library import packet_width
from ..processor import converts_halves, has_instructions, slow_gathers
from .lanes import ELEMENTS, FLAGS, INTEGERS, LANES, SUFFIX, WORD, Lanes, declared, takes, vector_of

_EIGHT = 8
_BYTE, _LONG = ir.IntType(8), ir.IntType(64)
_TABLE = "framearray.flagged.first"
_SHORT_SHIFT = 14  # last bits of a float32 that a short number lacks, with its sign and the first bit of its exponent
_SHORT_SCALE = 2.0**60
_SHORTS = 2.0**-66, (2.0 - 2.0**-9) * _SHORT_SCALE  # the smallest and the largest short number, but 0
_LARGEST_HALF = 0x477FE000  # 65504 as the bits of a float32
# What the two results of a step of `_exchanged` take from two vectors: each step is one instruction of AVX.
_NUMBERS = [0, 8, 1, 9, 4, 12, 5, 13], [2, 10, 3, 11, 6, 14, 7, 15]
_PAIRS = [0, 1, 8, 9, 4, 5, 12, 13], [2, 3, 10, 11, 6, 7, 14, 15]
_HALVES = [0, 1, 2, 3, 8, 9, 10, 11], [4, 5, 6, 7, 12, 13, 14, 15]
TILE = 8  # rows and columns that are exchanged in registers at once: sixteen would not fit with AVX2


def _is_array(array: Any, lanes: Any = None) -> bool:
    """Return True for the type of a contiguous array of a dtype that lanes can have, or of the dtype of given lanes."""
    fits = isinstance(array, types.Array) and array.layout == "C" and array.dtype in ELEMENTS
    return fits and array.dtype != types.boolean and (lanes is None or lanes == Lanes(array.dtype))


def _place_of(context: Any, builder: Any, array_type: Any, array: Any, offset_type: Any, offset: Any) -> Any:
    """The address of the element at a flat offset of a contiguous array."""
    data = context.make_array(array_type)(context, builder, array).data
    return builder.gep(data, [context.cast(builder, offset, offset_type, types.intp)])


def _pointer_to_lanes(builder: Any, place: Any, lanes: Lanes) -> Any:
    return builder.bitcast(place, vector_of(lanes).as_pointer())


@intrinsic
def load(typingctx: Any, array: Any, offset: Any) -> Any:
    """Load elements offset to offset + 15 of a contiguous array."""
    if not _is_array(array):
        return None
    lanes = Lanes(array.dtype)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        place = _place_of(context, builder, sig.args[0], args[0], sig.args[1], args[1])
        return builder.load(_pointer_to_lanes(builder, place, lanes), align=4)

    return lanes(array, offset), codegen


@intrinsic
def lanes_from(typingctx: Any, address: Any) -> Any:
    """Load 16 float32 numbers from an address."""
    lanes = Lanes(types.float32)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        place = builder.inttoptr(args[0], vector_of(lanes).as_pointer())
        return builder.load(place, align=4)

    return lanes(types.intp), codegen


@intrinsic
def shorts_from(typingctx: Any, address: Any) -> Any:
    """Load 16 short numbers from an address, see `put_shorts`, as float32."""
    lanes = Lanes(types.float32)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        place = builder.inttoptr(args[0], ir.VectorType(ir.IntType(16), LANES).as_pointer())
        whole = builder.zext(builder.load(place, align=4), ir.VectorType(WORD, LANES))
        scaled = builder.bitcast(builder.shl(whole, _in_all(_SHORT_SHIFT)), vector_of(lanes))
        return builder.fmul(scaled, _in_all(_SHORT_SCALE))

    return lanes(types.intp), codegen


@intrinsic
def put_shorts(typingctx: Any, array: Any, offset: Any, value: Any) -> Any:
    """Store 16 float32 numbers, not negative, as short ones: 7 bits of exponent and 9 of fraction, rounded to nearest.

    They reach from 1e-20 to 2e18: smaller numbers become 0, larger ones the largest.

    Args:
        array: of bytes, from `offset` on.
    """
    if not (isinstance(array, types.Array) and array.dtype == types.uint8 and value == Lanes(types.float32)):
        return None

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        place = _place_of(context, builder, sig.args[0], args[0], sig.args[1], args[1])
        zero, smallest, largest = (_in_all(number) for number in (0.0, *_SHORTS))
        value = builder.select(builder.fcmp_ordered("<", args[2], largest), args[2], largest)
        value = builder.select(builder.fcmp_ordered("<", value, smallest), zero, value)
        bits = builder.bitcast(builder.fmul(value, _in_all(1.0 / _SHORT_SCALE)), ir.VectorType(WORD, LANES))
        bits = builder.lshr(builder.add(bits, _in_all(1 << _SHORT_SHIFT - 1)), _in_all(_SHORT_SHIFT))
        short = ir.VectorType(ir.IntType(16), LANES)
        builder.store(builder.trunc(bits, short), builder.bitcast(place, short.as_pointer()), align=4)
        return context.get_dummy_value()

    return types.void(array, offset, value), codegen


def _in_all(number: float) -> Any:
    """A whole number or a float32 in all lanes."""
    element = WORD if isinstance(number, int) else ir.FloatType()
    return ir.Constant(ir.VectorType(element, LANES), [number] * LANES)


@intrinsic
def store(typingctx: Any, array: Any, offset: Any, value: Any) -> Any:
    """Store to elements offset to offset + 15 of a contiguous array; a single number goes to all of them."""
    if not _is_array(array) or not (value == Lanes(array.dtype) or takes(Lanes(array.dtype), value)):
        return None

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        place = _place_of(context, builder, sig.args[0], args[0], sig.args[1], args[1])
        value = context.cast(builder, args[2], sig.args[2], Lanes(sig.args[0].dtype))
        builder.store(value, _pointer_to_lanes(builder, place, Lanes(sig.args[0].dtype)), align=4)
        return context.get_dummy_value()

    return types.void(array, offset, value), codegen


def _gather_of(typingctx: Any, array: Any, offsets: Any) -> Any:
    """Load the elements of a contiguous array at 16 offsets, or one element at one offset."""
    if not _is_array(array) or not (offsets == INTEGERS or isinstance(offsets, types.Integer)):
        return None
    if not isinstance(offsets, Lanes):

        def one(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            return builder.load(_place_of(context, builder, sig.args[0], args[0], sig.args[1], args[1]))

        return array.dtype(array, offsets), one
    lanes = Lanes(array.dtype)
    at_once = array.dtype in (types.float32, types.int32) and not slow_gathers()

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        data = context.make_array(sig.args[0])(context, builder, args[0]).data
        if at_once:
            return _gathered(builder, lanes, data, args[1])
        result = ir.Constant(vector_of(lanes), ir.Undefined)
        for lane in range(LANES):
            offset = builder.sext(builder.extract_element(args[1], WORD(lane)), ir.IntType(64))
            result = builder.insert_element(result, builder.load(builder.gep(data, [offset])), WORD(lane))
        return result

    return lanes(array, offsets), codegen


gather: Any = intrinsic(_gather_of)


@intrinsic
def row_at(typingctx: Any, array: Any, offsets: Any) -> Any:
    """Load one element of a contiguous array at an offset, or sixteen in a row at offsets that count up in lanes."""
    if offsets != INTEGERS:
        return _gather_of(typingctx, array, offsets)
    if not _is_array(array):
        return None
    lanes = Lanes(array.dtype)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        first = builder.extract_element(args[1], WORD(0))
        place = _place_of(context, builder, sig.args[0], args[0], types.int32, first)
        return builder.load(_pointer_to_lanes(builder, place, lanes), align=4)

    return lanes(array, offsets), codegen


def _gathered(builder: Any, lanes: Lanes, data: Any, offsets: Any) -> Any:
    """LLVM's gather; it becomes single loads on processors without such an instruction."""
    result, flags = vector_of(lanes), vector_of(FLAGS)
    wide = builder.sext(offsets, ir.VectorType(ir.IntType(64), LANES))
    at, places = builder.gep(data, [ir.IntType(64)(0)]), ir.VectorType(data.type, LANES)
    at.indices, at.type = [wide], places  # llvmlite's builder cannot index by vectors; LLVM can
    suffix = SUFFIX[lanes.dtype]
    kind = ir.FunctionType(result, [places, WORD, flags, result])
    load = declared(builder.module, kind, f"llvm.masked.gather.v{LANES}{suffix}.v{LANES}p0{suffix}")
    return builder.call(load, [at, WORD(4), ir.Constant(flags, [1] * LANES), ir.Constant(result, ir.Undefined)])


@intrinsic
def triples_at(typingctx: Any, array: Any, row: Any) -> Any:
    """Load rows `row` to `row` + 15 of a contiguous (n, 3) array, as three columns."""
    if not _is_array(array) or not isinstance(row, types.Integer):
        return None
    lanes = Lanes(array.dtype)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        parts = [builder.load(place, align=4) for place in _thirds(context, builder, sig, args)]
        columns = []
        for axis in range(3):
            at = [3 * lane + axis for lane in range(LANES)]
            columns.append(_picked(builder, parts, at))
        return context.make_tuple(builder, sig.return_type, columns)

    return types.UniTuple(lanes, 3)(array, row), codegen


@intrinsic
def put_triples(typingctx: Any, array: Any, row: Any, x: Any, y: Any, z: Any) -> Any:
    """Store three columns to rows `row` to `row` + 15 of a contiguous (n, 3) array."""
    if not _is_array(array, x) or not isinstance(row, types.Integer) or not x == y == z:
        return None

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        for part, place in enumerate(_thirds(context, builder, sig, args)):
            numbers = [divmod(part * LANES + lane, 3) for lane in range(LANES)]  # row and axis of each
            builder.store(_picked(builder, args[2:], [axis * LANES + row for row, axis in numbers]), place, align=4)
        return context.get_dummy_value()

    return types.void(array, row, x, y, z), codegen


def _thirds(context: Any, builder: Any, sig: Any, args: Any) -> list[Any]:
    """Pointers to the three vectors of sixteen numbers that sixteen rows consist of."""
    row = context.cast(builder, args[1], sig.args[1], types.intp)
    offsets = [builder.add(builder.mul(row, ir.IntType(64)(3)), ir.IntType(64)(part * LANES)) for part in range(3)]
    places = [_place_of(context, builder, sig.args[0], args[0], types.intp, offset) for offset in offsets]
    return [_pointer_to_lanes(builder, place, Lanes(sig.args[0].dtype)) for place in places]


def _picked(builder: Any, three: Any, numbers: list[int]) -> Any:
    """Pick sixteen of the 48 numbers of three vectors."""
    a, b, c = three

    def constant(indices: list[int]) -> Any:
        return ir.Constant(ir.VectorType(WORD, LANES), indices)

    of_two = builder.shuffle_vector(a, b, constant([min(i, 2 * LANES - 1) for i in numbers]))
    last = [lane if i < 2 * LANES else i - LANES for lane, i in enumerate(numbers)]
    return builder.shuffle_vector(of_two, c, constant(last))


@intrinsic
def scatter(typingctx: Any, array: Any, offsets: Any, value: Any) -> Any:
    """Store 16 values at 16 offsets of a contiguous array."""
    if not _is_array(array, value) or offsets != INTEGERS:
        return None

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        data = context.make_array(sig.args[0])(context, builder, args[0]).data
        for lane in range(LANES):
            offset = builder.sext(builder.extract_element(args[1], WORD(lane)), ir.IntType(64))
            builder.store(builder.extract_element(args[2], WORD(lane)), builder.gep(data, [offset]))
        return context.get_dummy_value()

    return types.void(array, offsets, value), codegen


@intrinsic
def compress(typingctx: Any, flags: Any, value: Any, array: Any, offset: Any) -> Any:
    """Store the flagged lanes next to each other in a contiguous array, from an offset on."""
    if flags != FLAGS or not _is_array(array, value) or array.dtype not in SUFFIX:
        return None

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        place = _place_of(context, builder, sig.args[2], args[2], sig.args[3], args[3])
        kind = ir.FunctionType(ir.VoidType(), [args[1].type, place.type, args[0].type])
        name = f"llvm.masked.compressstore.v{LANES}{SUFFIX[sig.args[1].dtype]}"
        builder.call(declared(builder.module, kind, name), [args[1], place, args[0]])
        return context.get_dummy_value()

    return types.void(flags, value, array, offset), codegen


@intrinsic
def append(typingctx: Any, flags: Any, value: Any, array: Any, offset: Any) -> Any:
    """Store the flagged lanes next to each other in a contiguous array of 32-bit numbers, from an offset on.

    Of the sixteen numbers from the offset on, those after the flagged ones are overwritten, too.
    """
    if flags != FLAGS or not _is_array(array, value) or array.dtype not in (types.float32, types.int32):
        return None

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        place = _place_of(context, builder, sig.args[2], args[2], sig.args[3], args[3])
        if has_instructions("avx512f"):
            _store_compressed(builder, args, sig.args[1], place)
        elif has_instructions("avx2"):
            _store_permuted(builder, args, place)
        else:
            kind = ir.FunctionType(ir.VoidType(), [args[1].type, place.type, args[0].type])
            name = f"llvm.masked.compressstore.v{LANES}{SUFFIX[sig.args[1].dtype]}"
            builder.call(declared(builder.module, kind, name), [args[1], place, args[0]])
        return context.get_dummy_value()

    return types.void(flags, value, array, offset), codegen


def _store_compressed(builder: Any, args: Any, lanes: Any, place: Any) -> None:
    """Compress in a register, and store all of it: storing only the flagged ones takes longer."""
    flags, value = args[:2]
    kind = ir.FunctionType(value.type, [value.type, flags.type, value.type])
    name = f"llvm.experimental.vector.compress.v{LANES}{SUFFIX[lanes.dtype]}"
    found = builder.call(declared(builder.module, kind, name), [value, flags, ir.Constant(value.type, ir.Undefined)])
    builder.store(found, _pointer_to_lanes(builder, place, lanes), align=4)


def _store_permuted(builder: Any, args: Any, place: Any) -> None:
    """Permute eight numbers at a time, by the row of the table for their flags."""
    words = ir.VectorType(WORD, _EIGHT)
    numbers = builder.bitcast(args[1], ir.VectorType(WORD, LANES))
    bits = builder.zext(builder.bitcast(args[0], ir.IntType(LANES)), _LONG)
    place = builder.bitcast(place, WORD.as_pointer())
    move = declared(builder.module, ir.FunctionType(words, [words, words]), "llvm.x86.avx2.permd")
    for first in range(0, LANES, _EIGHT):
        pattern = builder.and_(builder.lshr(bits, _LONG(first)), _LONG(0xFF))
        row = builder.load(builder.gep(_table(builder), [_LONG(0), pattern]), align=8)
        order = builder.zext(builder.bitcast(row, ir.VectorType(_BYTE, _EIGHT)), words)
        lanes = ir.Constant(words, list(range(first, first + _EIGHT)))
        part = builder.shuffle_vector(numbers, numbers, lanes)
        builder.store(builder.call(move, [part, order]), builder.bitcast(place, words.as_pointer()), align=4)
        place = builder.gep(place, [builder.ctpop(pattern)])


def _table(builder: Any) -> Any:
    """A row for each pattern of eight flags: the numbers of the flagged lanes, a byte each, and then any."""
    module = builder.module
    if _TABLE not in module.globals:
        rows = []
        for pattern in range(1 << _EIGHT):
            flagged = [lane for lane in range(_EIGHT) if pattern >> lane & 1]
            rows.append(int.from_bytes(bytes(flagged).ljust(_EIGHT, b"\0"), "little"))
        cgutils.global_constant(module, _TABLE, ir.Constant(ir.ArrayType(_LONG, len(rows)), rows))
    return module.globals[_TABLE]


def _are_packets(packets: Any) -> bool:
    kind = isinstance(packets, types.Array) and packets.layout == "C" and packets.ndim == 3
    return kind and packets.dtype in (types.float32, types.int32) and packets.dtype in ELEMENTS


@intrinsic
def width_of_packets(typingctx: Any) -> Any:
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


@intrinsic
def load_row(typingctx: Any, packets: Any, first: Any, row: Any) -> Any:
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


@intrinsic
def store_row(typingctx: Any, packets: Any, first: Any, row: Any, value: Any) -> Any:
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


@intrinsic
def stored(typingctx: Any, array: Any, value: Any) -> Any:
    """Convert float32 numbers to what an array stores: themselves, or for uint16 the bits of halves."""
    if not isinstance(array, types.Array) or value != Lanes(types.float32):
        return None
    if array.dtype == types.float32:
        return value(array, value), lambda context, builder, sig, args: args[1]
    return Lanes(types.uint16)(array, value), lambda context, builder, sig, args: _halves(builder, args[1])


@intrinsic
def store_columns(typingctx: Any, rows: Any, first: Any, stride: Any, n: Any, array: Any, to: Any, step: Any) -> Any:
    """Store the first n columns of sixteen rows of sixteen float32 numbers, each column as sixteen numbers in a row.

    Row r starts at first + r stride of a contiguous array, column k is stored from to + k step of another one, as that
    array stores numbers; see `stored`.
    """
    if not _is_array(rows) or rows.dtype != types.float32 or not _is_array(array):
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
                    place = _place_of(context, builder, sig.args[0], args[0], word, builder.add(at, at.type(left)))
                    tile.append(builder.load(builder.bitcast(place, source), align=4))
                for k, column in enumerate(_exchanged(builder, tile)):
                    with builder.if_then(builder.icmp_signed(">", count, count.type(left + k)), likely=True):
                        value = column if sig.args[4].dtype == types.float32 else _halves(builder, column)
                        at = builder.add(goal, builder.mul(leap, leap.type(left + k)))
                        place = _place_of(context, builder, sig.args[4], args[4], word, builder.add(at, at.type(top)))
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
