"""Sixteen numbers: their type, operators and functions.

Each `intrinsic` types one function of kernels, and generates its LLVM code.
"""

import operator
from collections.abc import Callable
from typing import Any, ClassVar

from llvmlite import ir
from numba import types
from numba.core import cgutils, datamodel
from numba.core.typing import templates
from numba.extending import intrinsic, lower_builtin, lower_cast

LANES = 16  # rays in a packet
declared = cgutils.get_or_insert_function
WORD = ir.IntType(32)
ELEMENTS = {
    types.float32: ir.FloatType(),
    types.float64: ir.DoubleType(),
    types.int32: WORD,
    types.uint8: ir.IntType(8),
    types.uint16: ir.IntType(16),
    types.uint64: ir.IntType(64),
    types.boolean: ir.IntType(1),
}
REAL = (types.float32, types.float64)
WHOLE = (types.int32, types.uint8, types.uint64)
SUFFIX = {types.float32: "f32", types.float64: "f64", types.int32: "i32", types.uint16: "i16"}
_FUSED = ("contract",)


class Lanes(types.Type):
    """The type of 16 values of one dtype."""

    def __init__(self, dtype: Any) -> None:
        self.dtype = dtype
        super().__init__(name=f"Lanes({dtype})")


INTEGERS, FLAGS = Lanes(types.int32), Lanes(types.boolean)


@datamodel.registry.register_default(Lanes)
class _LanesModel(datamodel.models.PrimitiveModel):
    def __init__(self, dmm: Any, fe_type: Lanes) -> None:
        super().__init__(dmm, fe_type, vector_of(fe_type))


def vector_of(lanes: Lanes) -> Any:
    """LLVM's vector type for lanes."""
    return ir.VectorType(ELEMENTS[lanes.dtype], LANES)


@lower_cast(types.Number, Lanes)
def _spread(context: Any, builder: Any, source: Any, target: Lanes, value: Any) -> Any:
    """Copy a number into all lanes."""
    element = context.cast(builder, value, source, target.dtype)
    vector = vector_of(target)
    one = builder.insert_element(ir.Constant(vector, ir.Undefined), element, WORD(0))
    return builder.shuffle_vector(
        one, ir.Constant(vector, ir.Undefined), ir.Constant(ir.VectorType(WORD, LANES), [0] * LANES)
    )


def takes(lanes: Lanes, number: Any) -> bool:
    """Return True if a number may be combined with lanes: integers with all, reals only with reals."""
    return isinstance(number, types.Integer) or (isinstance(number, types.Float) and lanes.dtype in REAL)


def _operator(function: Any, compute: Callable[..., Any], dtypes: tuple[Any, ...], flags: bool = False) -> None:
    """Define an operator for two lanes of one dtype, or for lanes and a number.

    Args:
        compute: generates the code from a builder, the dtype and the operands.
        dtypes: those that have the operator.
        flags: whether the result is flags instead of lanes of the same dtype.
    """

    class _Typed(templates.AbstractTemplate):
        metadata: ClassVar = {"target": "cpu"}  # makes numba try this first, before some thirty of its own

        def generic(self, args: Any, kws: Any) -> Any:
            lanes = [arg for arg in args if isinstance(arg, Lanes)]
            rest = [arg for arg in args if not isinstance(arg, Lanes)]
            if not lanes or not all(lane == lanes[0] for lane in lanes) or not all(takes(lanes[0], n) for n in rest):
                return None
            if lanes[0].dtype not in dtypes:
                return None
            return templates.signature(FLAGS if flags else lanes[0], *([lanes[0]] * len(args)))

    templates.infer_global(function)(_Typed)

    def lowered(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return compute(builder, sig.args[0].dtype, *args)

    for n in (1, 2):
        lower_builtin(function, *([Lanes] * n))(lowered)


def _binary(of_reals: str, of_integers: str = "") -> Callable[..., Any]:
    def compute(builder: Any, dtype: Any, a: Any, b: Any) -> Any:
        return getattr(builder, of_reals)(a, b, flags=_FUSED) if dtype in REAL else getattr(builder, of_integers)(a, b)

    return compute


def _compared(sign: str) -> Callable[..., Any]:
    def compute(builder: Any, dtype: Any, a: Any, b: Any) -> Any:
        if dtype in REAL:
            return builder.fcmp_ordered(sign, a, b)
        return builder.icmp_signed(sign, a, b) if dtype == types.int32 else builder.icmp_unsigned(sign, a, b)

    return compute


_BITS = (*WHOLE, types.boolean)
_operator(operator.add, _binary("fadd", "add"), (*REAL, *WHOLE))
_operator(operator.sub, _binary("fsub", "sub"), (*REAL, *WHOLE))
_operator(operator.mul, _binary("fmul", "mul"), (*REAL, *WHOLE))
_operator(operator.truediv, _binary("fdiv"), REAL)
_operator(operator.and_, _binary("", "and_"), _BITS)
_operator(operator.or_, _binary("", "or_"), _BITS)
_operator(operator.xor, _binary("", "xor"), _BITS)
_operator(operator.rshift, _binary("", "lshr"), WHOLE)
_operator(operator.neg, lambda builder, dtype, a: builder.fneg(a) if dtype in REAL else builder.neg(a), (*REAL, *WHOLE))
_operator(operator.invert, lambda builder, dtype, a: builder.not_(a), _BITS)
for _sign, _compare in (
    ("<", operator.lt),
    ("<=", operator.le),
    (">", operator.gt),
    (">=", operator.ge),
    ("==", operator.eq),
):
    _operator(_compare, _compared(_sign), (*REAL, *WHOLE), flags=True)


@intrinsic
def product(typingctx: Any, a: Any, b: Any) -> Any:
    """The product of lanes of reals and lanes or a number, rounded even where it is added to something."""
    if not isinstance(a, Lanes) or a.dtype not in REAL or not (b == a or takes(a, b)):
        return None

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.fmul(args[0], context.cast(builder, args[1], sig.args[1], sig.args[0]))

    return a(a, b), codegen


@intrinsic
def popcount(typingctx: Any, flags: Any) -> Any:
    """Count the lanes that are flagged; a single flag counts 0 or 1."""
    if flags not in (FLAGS, types.boolean):
        return None

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        if not isinstance(sig.args[0], Lanes):
            return builder.zext(args[0], ir.IntType(64))
        bits = builder.zext(builder.bitcast(args[0], ir.IntType(LANES)), ir.IntType(64))
        return builder.ctpop(bits)

    return types.intp(flags), codegen


@intrinsic
def bits(typingctx: Any, flags: Any) -> Any:
    """Pack the flags into the bits of a number; lane 0 is the lowest bit."""
    if flags != FLAGS:
        return None

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.zext(builder.bitcast(args[0], ir.IntType(LANES)), ir.IntType(64))

    return types.intp(flags), codegen


@intrinsic
def ctz(typingctx: Any, bits: Any) -> Any:
    """Count the trailing zeros of a number: the index of its lowest bit that is set."""

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.cttz(args[0], ir.Constant(ir.IntType(1), 0))

    return types.intp(types.intp), codegen


@intrinsic
def select(typingctx: Any, flags: Any, yes: Any, no: Any) -> Any:
    """Select `yes` where flagged, else `no`; either may be a number. A single flag selects without a jump."""
    if flags not in (FLAGS, types.boolean):
        return None
    lanes = next((arg for arg in (yes, no) if isinstance(arg, Lanes)), None)
    if lanes is not None and not all(arg == lanes or takes(lanes, arg) for arg in (yes, no)):
        return None
    if lanes is None:
        number = typingctx.unify_types(yes, no)
        lanes = Lanes(number) if isinstance(flags, Lanes) else number

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        yes, no = (context.cast(builder, args[i], sig.args[i], lanes) for i in (1, 2))
        return builder.select(args[0], yes, no)

    return lanes(flags, yes, no), codegen


def _across(combine: Callable[..., Any]) -> Callable[..., Any]:
    """A float32 number of all 16, combined in pairs: lane 0 and 8, then those results likewise."""

    def of(typingctx: Any, value: Any) -> Any:
        if value != Lanes(types.float32):
            return None

        def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            lanes, undefined = args[0], ir.Constant(args[0].type, ir.Undefined)
            for step in (8, 4, 2, 1):
                order = [(lane + step) % LANES for lane in range(LANES)]
                mask = ir.Constant(ir.VectorType(ir.IntType(32), LANES), order)
                lanes = combine(builder, lanes, builder.shuffle_vector(lanes, undefined, mask))
            return builder.extract_element(lanes, ir.IntType(32)(0))

        return types.float32(value), codegen

    return of


def _function(name: str) -> Callable[..., Any]:
    """An LLVM function of reals, for lanes or for one number."""

    def of(typingctx: Any, value: Any) -> Any:
        if (value.dtype if isinstance(value, Lanes) else value) not in REAL:
            return None

        def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            kind, of = ir.FunctionType(args[0].type, [args[0].type]), sig.args[0]
            suffix = f"v{LANES}{SUFFIX[of.dtype]}" if isinstance(of, Lanes) else SUFFIX[of]
            return builder.call(declared(builder.module, kind, f"llvm.{name}.{suffix}"), args)

        return value(value), codegen

    return of


def _converted(dtype: Any) -> Callable[..., Any]:
    """The conversion to a dtype, for lanes or for one number."""
    lanes = Lanes(dtype)

    def of(typingctx: Any, value: Any) -> Any:
        if not isinstance(value, Lanes):
            return dtype(value), lambda context, builder, sig, args: context.cast(builder, args[0], value, dtype)

        def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            source, target = sig.args[0].dtype, vector_of(lanes)
            if source == dtype:
                return args[0]
            if {source, dtype} <= set(WHOLE):
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


@intrinsic
def lane_numbers(typingctx: Any) -> Any:
    """The numbers 0 to 15, one per lane."""

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return ir.Constant(vector_of(INTEGERS), list(range(LANES)))

    return INTEGERS(), codegen


sqrt: Any = intrinsic(_function("sqrt"))
floor: Any = intrinsic(_function("floor"))
reals: Any = intrinsic(_converted(types.float32))
doubles: Any = intrinsic(_converted(types.float64))
integers: Any = intrinsic(_converted(types.int32))
words: Any = intrinsic(_converted(types.uint64))
sum_of_lanes: Any = intrinsic(_across(lambda builder, a, b: builder.fadd(a, b)))
largest_of_lanes: Any = intrinsic(_across(lambda builder, a, b: builder.select(builder.fcmp_ordered(">", a, b), a, b)))
