"""The type of sixteen numbers, and which numbers may be its other operand."""

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils, datamodel
from numba.extending import lower_cast

LANES = 16  # rays in a packet
# Parts of numba without type annotations.
_Type: Any = types.Type
_PrimitiveModel: Any = datamodel.models.PrimitiveModel
_register: Any = datamodel.registry.register_default
_lower_cast: Any = lower_cast
declared: Any = cgutils.get_or_insert_function
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


class Lanes(_Type):  # type: ignore[misc]
    """The type of 16 values of one dtype."""

    def __init__(self, dtype: Any) -> None:
        self.dtype = dtype
        super().__init__(name=f"Lanes({dtype})")


INTEGERS, FLAGS = Lanes(types.int32), Lanes(types.boolean)


@_register(Lanes)
class _LanesModel(_PrimitiveModel):  # type: ignore[misc]
    def __init__(self, dmm: Any, fe_type: Lanes) -> None:
        super().__init__(dmm, fe_type, vector_of(fe_type))


def vector_of(lanes: Lanes) -> Any:
    """LLVM's vector type for lanes."""
    return ir.VectorType(ELEMENTS[lanes.dtype], LANES)


@_lower_cast(types.Number, Lanes)  # type: ignore[untyped-decorator,unused-ignore]
def _spread(context: Any, builder: Any, source: Any, target: Lanes, value: Any) -> Any:
    """Copy a number into all lanes."""
    element = context.cast(builder, value, source, target.dtype)
    vector = vector_of(target)
    one = builder.insert_element(ir.Constant(vector, ir.Undefined), element, WORD(0))
    return builder.shuffle_vector(
        one, ir.Constant(vector, ir.Undefined), ir.Constant(ir.VectorType(WORD, LANES), [0] * LANES)
    )


def takes(lanes: Lanes, number: Any) -> bool:
    """Whether a number may be combined with lanes: integers with all, reals only with reals."""
    return isinstance(number, types.Integer) or (isinstance(number, types.Float) and lanes.dtype in REAL)
