"""Load sixteen numbers from arrays and store them: contiguous, as rows of three, or at any offsets.

Offsets count elements of the flat array; nothing checks them. Each `_..._of` types one function of kernels, and
generates its LLVM code.
"""

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from ..cache import slow_gathers
from .types import ELEMENTS, FLAGS, INTEGERS, LANES, SUFFIX, WORD, Lanes, declared, takes, vector_of

_Tuple: Any = types.UniTuple  # numba does not annotate it


def _is_array(array: Any, lanes: Any = None) -> bool:
    """Whether a type is a contiguous array of a dtype that lanes can have, or of the dtype of the given lanes."""
    fits = isinstance(array, types.Array) and array.layout == "C" and array.dtype in ELEMENTS
    return fits and array.dtype != types.boolean and (lanes is None or lanes == Lanes(array.dtype))


def _place(context: Any, builder: Any, array_type: Any, array: Any, offset_type: Any, offset: Any) -> Any:
    """The address of the element at a flat offset of a contiguous array."""
    data = context.make_array(array_type)(context, builder, array).data
    return builder.gep(data, [context.cast(builder, offset, offset_type, types.intp)])


def _pointer_to_lanes(builder: Any, place: Any, lanes: Lanes) -> Any:
    return builder.bitcast(place, vector_of(lanes).as_pointer())


def _load_of(typingctx: Any, array: Any, offset: Any) -> Any:
    """Load elements offset to offset + 15 of a contiguous array."""
    if not _is_array(array):
        return None
    lanes = Lanes(array.dtype)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        place = _place(context, builder, sig.args[0], args[0], sig.args[1], args[1])
        return builder.load(_pointer_to_lanes(builder, place, lanes), align=4)

    return lanes(array, offset), codegen


def _lanes_from_of(typingctx: Any, address: Any) -> Any:
    """Load 16 float32 numbers from an address."""
    lanes = Lanes(types.float32)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        place = builder.inttoptr(args[0], vector_of(lanes).as_pointer())
        return builder.load(place, align=4)

    return lanes(types.intp), codegen


def _store_of(typingctx: Any, array: Any, offset: Any, value: Any) -> Any:
    """Store to elements offset to offset + 15 of a contiguous array; a single number goes to all of them."""
    if not _is_array(array) or not (value == Lanes(array.dtype) or takes(Lanes(array.dtype), value)):
        return None

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        place = _place(context, builder, sig.args[0], args[0], sig.args[1], args[1])
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
            return builder.load(_place(context, builder, sig.args[0], args[0], sig.args[1], args[1]))

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


def _triples_at_of(typingctx: Any, array: Any, row: Any) -> Any:
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

    return _Tuple(lanes, 3)(array, row), codegen


def _put_triples_of(typingctx: Any, array: Any, row: Any, x: Any, y: Any, z: Any) -> Any:
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
    places = [_place(context, builder, sig.args[0], args[0], types.intp, offset) for offset in offsets]
    return [_pointer_to_lanes(builder, place, Lanes(sig.args[0].dtype)) for place in places]


def _picked(builder: Any, three: Any, numbers: list[int]) -> Any:
    """Pick sixteen of the 48 numbers of three vectors."""
    a, b, c = three

    def constant(indices: list[int]) -> Any:
        return ir.Constant(ir.VectorType(WORD, LANES), indices)

    of_two = builder.shuffle_vector(a, b, constant([min(i, 2 * LANES - 1) for i in numbers]))
    last = [lane if i < 2 * LANES else i - LANES for lane, i in enumerate(numbers)]
    return builder.shuffle_vector(of_two, c, constant(last))


def _scatter_of(typingctx: Any, array: Any, offsets: Any, value: Any) -> Any:
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


def _compress_of(typingctx: Any, flags: Any, value: Any, array: Any, offset: Any) -> Any:
    """Store the flagged lanes next to each other in a contiguous array, from an offset on."""
    if flags != FLAGS or not _is_array(array, value) or array.dtype not in SUFFIX:
        return None

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        place = _place(context, builder, sig.args[2], args[2], sig.args[3], args[3])
        kind = ir.FunctionType(ir.VoidType(), [args[1].type, place.type, args[0].type])
        name = f"llvm.masked.compressstore.v{LANES}{SUFFIX[sig.args[1].dtype]}"
        builder.call(declared(builder.module, kind, name), [args[1], place, args[0]])
        return context.get_dummy_value()

    return types.void(flags, value, array, offset), codegen


load: Any = intrinsic(_load_of)
lanes_from: Any = intrinsic(_lanes_from_of)
store: Any = intrinsic(_store_of)
gather: Any = intrinsic(_gather_of)
triples_at: Any = intrinsic(_triples_at_of)
put_triples: Any = intrinsic(_put_triples_of)
scatter: Any = intrinsic(_scatter_of)
compress: Any = intrinsic(_compress_of)
