"""Sixteen numbers at a time in kernels: the lanes of a ray packet, computed with one instruction each.

LLVM turns plain loops into such instructions only where it can prove that no array overlaps another, which it cannot
for loops that look things up. Kernels that write packets therefore say what they want: `Lanes` of float32, float64,
int32, uint8 or uint64, and flags, with the operators of numbers. On processors with narrower registers LLVM splits
the operations.

What is written with `choose`, `gather`, `root` and their like works for single numbers, too.

Two things differ from numbers one at a time: sums and products may be fused (one rounding instead of two), and whole
numbers are shifted to the right as bits, without their sign. What does not fit together is an error of typing.
"""

import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils, datamodel
from numba.core.typing import templates
from numba.extending import intrinsic, lower_builtin, lower_cast

LANES = 16  # that many numbers
# What of numba has no types.
_Type: Any = types.Type
_PrimitiveModel: Any = datamodel.models.PrimitiveModel
_Template: Any = templates.AbstractTemplate
_register: Any = datamodel.registry.register_default
_signature: Any = templates.signature
_infer: Any = templates.infer_global
_lower_builtin: Any = lower_builtin
_lower_cast: Any = lower_cast
_declare: Any = cgutils.get_or_insert_function
_WORD = ir.IntType(32)
_ELEMENTS = {
    types.float32: ir.FloatType(),
    types.float64: ir.DoubleType(),
    types.int32: _WORD,
    types.uint8: ir.IntType(8),
    types.uint16: ir.IntType(16),
    types.uint64: ir.IntType(64),
    types.boolean: ir.IntType(1),
}
_REAL = (types.float32, types.float64)
_WHOLE = (types.int32, types.uint8, types.uint64)
_SUFFIX = {types.float32: "f32", types.float64: "f64", types.int32: "i32", types.uint16: "i16"}
_FUSED = ("contract",)
_LARGEST_HALF = 0x477FE000  # 65504 as the bits of a float32


class Lanes(_Type):  # type: ignore[misc]
    """The type of 16 values of one dtype."""

    def __init__(self, dtype: Any) -> None:
        self.dtype = dtype
        super().__init__(name=f"Lanes({dtype})")


INTEGERS, FLAGS = Lanes(types.int32), Lanes(types.boolean)


@_register(Lanes)
class _LanesModel(_PrimitiveModel):  # type: ignore[misc]
    def __init__(self, dmm: Any, fe_type: Lanes) -> None:
        super().__init__(dmm, fe_type, _vector(fe_type))


def _vector(lanes: Lanes) -> Any:
    return ir.VectorType(_ELEMENTS[lanes.dtype], LANES)


@_lower_cast(types.Number, Lanes)  # type: ignore[untyped-decorator,unused-ignore]
def _spread(context: Any, builder: Any, source: Any, target: Lanes, value: Any) -> Any:
    """The same number in all lanes."""
    element = context.cast(builder, value, source, target.dtype)
    vector = _vector(target)
    one = builder.insert_element(ir.Constant(vector, ir.Undefined), element, _WORD(0))
    return builder.shuffle_vector(
        one, ir.Constant(vector, ir.Undefined), ir.Constant(ir.VectorType(_WORD, LANES), [0] * LANES)
    )


def _operator(function: Any, compute: Callable[..., Any], dtypes: tuple[Any, ...], flags: bool = False) -> None:
    """Define an operator of two lanes of one dtype, or of lanes and a number."""

    class _Typed(_Template):  # type: ignore[misc]
        def generic(self, args: Any, kws: Any) -> Any:
            lanes = [arg for arg in args if isinstance(arg, Lanes)]
            rest = [arg for arg in args if not isinstance(arg, Lanes)]
            if not lanes or not all(lane == lanes[0] for lane in lanes) or not all(_takes(lanes[0], n) for n in rest):
                return None
            if lanes[0].dtype not in dtypes:
                return None
            return _signature(FLAGS if flags else lanes[0], *([lanes[0]] * len(args)))

    _infer(function)(_Typed)

    def lowered(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return compute(builder, sig.args[0].dtype, *args)

    for n in (1, 2):
        _lower_builtin(function, *([Lanes] * n))(lowered)


def _takes(lanes: Lanes, number: Any) -> bool:
    """Whether a number may stand beside lanes: whole ones beside all, others beside reals."""
    return isinstance(number, types.Integer) or (isinstance(number, types.Float) and lanes.dtype in _REAL)


def _binary(of_reals: str, of_integers: str = "") -> Callable[..., Any]:
    def compute(builder: Any, dtype: Any, a: Any, b: Any) -> Any:
        return getattr(builder, of_reals)(a, b, flags=_FUSED) if dtype in _REAL else getattr(builder, of_integers)(a, b)

    return compute


def _compared(sign: str) -> Callable[..., Any]:
    def compute(builder: Any, dtype: Any, a: Any, b: Any) -> Any:
        if dtype in _REAL:
            return builder.fcmp_ordered(sign, a, b)
        return builder.icmp_signed(sign, a, b) if dtype == types.int32 else builder.icmp_unsigned(sign, a, b)

    return compute


_BITS = (*_WHOLE, types.boolean)
_operator(operator.add, _binary("fadd", "add"), (*_REAL, *_WHOLE))
_operator(operator.sub, _binary("fsub", "sub"), (*_REAL, *_WHOLE))
_operator(operator.mul, _binary("fmul", "mul"), (*_REAL, *_WHOLE))
_operator(operator.truediv, _binary("fdiv"), _REAL)
_operator(operator.and_, _binary("", "and_"), _BITS)
_operator(operator.or_, _binary("", "or_"), _BITS)
_operator(operator.xor, _binary("", "xor"), _BITS)
_operator(operator.rshift, _binary("", "lshr"), _WHOLE)
_operator(
    operator.neg, lambda builder, dtype, a: builder.fneg(a) if dtype in _REAL else builder.neg(a), (*_REAL, *_WHOLE)
)
_operator(operator.invert, lambda builder, dtype, a: builder.not_(a), _BITS)
for _sign, _compare in (
    ("<", operator.lt),
    ("<=", operator.le),
    (">", operator.gt),
    (">=", operator.ge),
    ("==", operator.eq),
):
    _operator(_compare, _compared(_sign), (*_REAL, *_WHOLE), flags=True)


def _is_array(array: Any, lanes: Any = None) -> bool:
    """Whether something is a contiguous array of a dtype that lanes have, or that these lanes have."""
    fits = isinstance(array, types.Array) and array.layout == "C" and array.dtype in _ELEMENTS
    return fits and array.dtype != types.boolean and (lanes is None or lanes == Lanes(array.dtype))


def _place(context: Any, builder: Any, array_type: Any, array: Any, offset_type: Any, offset: Any) -> Any:
    """The address of the element at a flat offset of a contiguous array."""
    data = context.make_array(array_type)(context, builder, array).data
    return builder.gep(data, [context.cast(builder, offset, offset_type, types.intp)])


def _pointer_to_lanes(builder: Any, place: Any, lanes: Lanes) -> Any:
    return builder.bitcast(place, _vector(lanes).as_pointer())


def _lanes_at_of(typingctx: Any, array: Any, offset: Any) -> Any:
    """Elements offset to offset + 15 of a contiguous array, counted flat."""
    if not _is_array(array):
        return None
    lanes = Lanes(array.dtype)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        place = _place(context, builder, sig.args[0], args[0], sig.args[1], args[1])
        return builder.load(_pointer_to_lanes(builder, place, lanes), align=4)

    return lanes(array, offset), codegen


def _lanes_from_of(typingctx: Any, address: Any) -> Any:
    """16 float32 numbers from an address on."""
    lanes = Lanes(types.float32)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        place = builder.inttoptr(args[0], _vector(lanes).as_pointer())
        return builder.load(place, align=4)

    return lanes(types.intp), codegen


def _put_lanes_of(typingctx: Any, array: Any, offset: Any, value: Any) -> Any:
    """Write elements offset to offset + 15 of a contiguous array, counted flat; a number goes to all of them."""
    if not _is_array(array) or not (value == Lanes(array.dtype) or _takes(Lanes(array.dtype), value)):
        return None

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        place = _place(context, builder, sig.args[0], args[0], sig.args[1], args[1])
        value = context.cast(builder, args[2], sig.args[2], Lanes(sig.args[0].dtype))
        builder.store(value, _pointer_to_lanes(builder, place, Lanes(sig.args[0].dtype)), align=4)
        return context.get_dummy_value()

    return types.void(array, offset, value), codegen


def _stored_of(typingctx: Any, array: Any, value: Any) -> Any:
    """Float32 numbers as an array stores them: as they are, or in uint16 as the bits of halves.

    A half is the nearest one, of two equally near ones the even; numbers beyond the largest half become that.
    """
    if not isinstance(array, types.Array) or value != Lanes(types.float32):
        return None
    if array.dtype == types.float32:
        return value(array, value), lambda context, builder, sig, args: args[1]

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        kind, reals = _vector(INTEGERS), _vector(sig.args[1])

        def number(x: int) -> Any:
            return ir.Constant(kind, [x] * LANES)

        bits = builder.bitcast(args[1], kind)
        sign = builder.and_(bits, number(-(1 << 31)))
        size = builder.xor(bits, sign)
        size = builder.select(builder.icmp_signed("<", size, number(_LARGEST_HALF)), size, number(_LARGEST_HALF))
        # one step of float32 is the smallest half there: adding it rounds to what a subnormal half can hold
        coarse = number((127 - 15 + 23 - 10 + 1) << 23)
        small = builder.fadd(builder.bitcast(size, reals), builder.bitcast(coarse, reals))
        small = builder.sub(builder.bitcast(small, kind), coarse)
        odd = builder.and_(builder.lshr(size, number(13)), number(1))
        normal = builder.add(builder.add(size, number(((15 - 127) << 23) + 0xFFF)), odd)
        normal = builder.lshr(normal, number(13))
        half = builder.select(builder.icmp_signed("<", size, number(113 << 23)), small, normal)
        half = builder.or_(half, builder.lshr(sign, number(16)))
        return builder.trunc(half, _vector(Lanes(types.uint16)))

    return Lanes(types.uint16)(array, value), codegen


def _gather_of(typingctx: Any, array: Any, offsets: Any) -> Any:
    """The elements of a contiguous array at 16 flat offsets, or the one at one offset."""
    if not _is_array(array) or not (offsets == INTEGERS or isinstance(offsets, types.Integer)):
        return None
    if not isinstance(offsets, Lanes):

        def one(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            return builder.load(_place(context, builder, sig.args[0], args[0], sig.args[1], args[1]))

        return array.dtype(array, offsets), one
    lanes = Lanes(array.dtype)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        data = context.make_array(sig.args[0])(context, builder, args[0]).data
        result = ir.Constant(_vector(lanes), ir.Undefined)
        for lane in range(LANES):
            offset = builder.sext(builder.extract_element(args[1], _WORD(lane)), ir.IntType(64))
            result = builder.insert_element(result, builder.load(builder.gep(data, [offset])), _WORD(lane))
        return result

    return lanes(array, offsets), codegen


def _scatter_of(typingctx: Any, array: Any, offsets: Any, value: Any) -> Any:
    """Write 16 values to the flat offsets of a contiguous array."""
    if not _is_array(array, value) or offsets != INTEGERS:
        return None

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        data = context.make_array(sig.args[0])(context, builder, args[0]).data
        for lane in range(LANES):
            offset = builder.sext(builder.extract_element(args[1], _WORD(lane)), ir.IntType(64))
            builder.store(builder.extract_element(args[2], _WORD(lane)), builder.gep(data, [offset]))
        return context.get_dummy_value()

    return types.void(array, offsets, value), codegen


def _compress_of(typingctx: Any, flags: Any, value: Any, array: Any, offset: Any) -> Any:
    """Write the flagged lanes one after another to a contiguous array, from a flat offset on."""
    if flags != FLAGS or not _is_array(array, value) or array.dtype not in _SUFFIX:
        return None

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        place = _place(context, builder, sig.args[2], args[2], sig.args[3], args[3])
        kind = ir.FunctionType(ir.VoidType(), [args[1].type, place.type, args[0].type])
        name = f"llvm.masked.compressstore.v{LANES}{_SUFFIX[sig.args[1].dtype]}"
        builder.call(_declare(builder.module, kind, name), [args[1], place, args[0]])
        return context.get_dummy_value()

    return types.void(flags, value, array, offset), codegen


def _count_of(typingctx: Any, flags: Any) -> Any:
    """How many lanes are flagged; of a single flag 0 or 1."""
    if flags not in (FLAGS, types.boolean):
        return None

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        if not isinstance(sig.args[0], Lanes):
            return builder.zext(args[0], ir.IntType(64))
        bits = builder.zext(builder.bitcast(args[0], ir.IntType(LANES)), ir.IntType(64))
        return builder.ctpop(bits)

    return types.intp(flags), codegen


def _bits_of(typingctx: Any, flags: Any) -> Any:
    """The flags as the bits of a number, lane 0 the lowest."""
    if flags != FLAGS:
        return None

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.zext(builder.bitcast(args[0], ir.IntType(LANES)), ir.IntType(64))

    return types.intp(flags), codegen


def _lowest_of(typingctx: Any, bits: Any) -> Any:
    """The number of zeros below the lowest one of a number's bits."""

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.cttz(args[0], ir.Constant(ir.IntType(1), 0))

    return types.intp(types.intp), codegen


def _choose_of(typingctx: Any, flags: Any, yes: Any, no: Any) -> Any:
    """`yes` where flagged, else `no`; either may be a number. With one flag, of two numbers, without a jump."""
    if flags not in (FLAGS, types.boolean):
        return None
    lanes = next((arg for arg in (yes, no) if isinstance(arg, Lanes)), None)
    if lanes is not None and not all(arg == lanes or _takes(lanes, arg) for arg in (yes, no)):
        return None
    if lanes is None:
        number = typingctx.unify_types(yes, no)
        lanes = Lanes(number) if isinstance(flags, Lanes) else number

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        yes, no = (context.cast(builder, args[i], sig.args[i], lanes) for i in (1, 2))
        return builder.select(args[0], yes, no)

    return lanes(flags, yes, no), codegen


def _function(name: str) -> Callable[..., Any]:
    def of(typingctx: Any, value: Any) -> Any:
        if (value.dtype if isinstance(value, Lanes) else value) not in _REAL:
            return None

        def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            kind, of = ir.FunctionType(args[0].type, [args[0].type]), sig.args[0]
            suffix = f"v{LANES}{_SUFFIX[of.dtype]}" if isinstance(of, Lanes) else _SUFFIX[of]
            return builder.call(_declare(builder.module, kind, f"llvm.{name}.{suffix}"), args)

        return value(value), codegen

    return of


def _converted(dtype: Any) -> Callable[..., Any]:
    lanes = Lanes(dtype)

    def of(typingctx: Any, value: Any) -> Any:
        if not isinstance(value, Lanes):
            return dtype(value), lambda context, builder, sig, args: context.cast(builder, args[0], value, dtype)

        def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            source, target = sig.args[0].dtype, _vector(lanes)
            if source == dtype:
                return args[0]
            if {source, dtype} <= set(_WHOLE):
                return (
                    builder.trunc(args[0], target)
                    if source.bitwidth > dtype.bitwidth
                    else builder.zext(args[0], target)
                )
            if dtype == types.int32:
                return builder.fptosi(args[0], target)
            if source == types.int32:
                return builder.sitofp(args[0], target)
            return builder.fpext(args[0], target) if dtype == types.float64 else builder.fptrunc(args[0], target)

        return lanes(value), codegen

    return of


def _lane_numbers_of(typingctx: Any) -> Any:
    """0 to 15."""

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return ir.Constant(_vector(INTEGERS), list(range(LANES)))

    return INTEGERS(), codegen


lanes_at: Any = intrinsic(_lanes_at_of)
lanes_from: Any = intrinsic(_lanes_from_of)
put_lanes: Any = intrinsic(_put_lanes_of)
stored: Any = intrinsic(_stored_of)
gather: Any = intrinsic(_gather_of)
scatter: Any = intrinsic(_scatter_of)
compress: Any = intrinsic(_compress_of)
count: Any = intrinsic(_count_of)
bits: Any = intrinsic(_bits_of)
lowest: Any = intrinsic(_lowest_of)
choose: Any = intrinsic(_choose_of)
root: Any = intrinsic(_function("sqrt"))
floor: Any = intrinsic(_function("floor"))
reals: Any = intrinsic(_converted(types.float32))
doubles: Any = intrinsic(_converted(types.float64))
integers: Any = intrinsic(_converted(types.int32))
words: Any = intrinsic(_converted(types.uint64))
lane_numbers: Any = intrinsic(_lane_numbers_of)
