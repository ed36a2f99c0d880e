"""Append the flagged lanes to a queue, at the cost of what lies behind its end.

Only processors with AVX-512 have an instruction that moves flagged numbers next to each other. With AVX2 eight numbers
are permuted at once, by a table of all 256 patterns of flags.
"""

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from ..instructions import has_instructions
from .memory import _is_array, _place, _pointer_to_lanes
from .types import FLAGS, LANES, SUFFIX, WORD, declared

_EIGHT = 8
_BYTE, _LONG = ir.IntType(8), ir.IntType(64)
_TABLE = "framearray.flagged.first"
_globals: Any = cgutils.global_constant


def _append_of(typingctx: Any, flags: Any, value: Any, array: Any, offset: Any) -> Any:
    """Store the flagged lanes next to each other in a contiguous array of 32-bit numbers, from an offset on.

    Of the sixteen numbers from the offset on, those after the flagged ones are overwritten, too.
    """
    if flags != FLAGS or not _is_array(array, value) or array.dtype not in (types.float32, types.int32):
        return None

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        place = _place(context, builder, sig.args[2], args[2], sig.args[3], args[3])
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
        _globals(module, _TABLE, ir.Constant(ir.ArrayType(_LONG, len(rows)), rows))
    return module.globals[_TABLE]


append: Any = intrinsic(_append_of)
