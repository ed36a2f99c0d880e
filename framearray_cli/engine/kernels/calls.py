"""Calls of kernels by kernels: by an address in memory, so that no kernel contains the code of another one.

numba compiles a callee before its caller, to learn what it returns, and once more as a part of the caller. Here an
annotation says what a callee returns, and the caller reads the address of its code from a slot, which is filled before
the caller runs. So processes compile a caller and its callees in any order, and at the same time.
"""

from . import start  # noqa: F401  # isort: skip  # before any of numba

import ctypes
import hashlib
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias, get_args, get_origin

from llvmlite import binding, ir
from numba.core import cgutils, serialize, types
from numba.core.typing import templates

from .second_process import KernelTakenError, without_waiting

# Name of this package: the digest of the cache covers the source of its kernels.
_PACKAGE = __name__.partition(".")[0]
_PREFIX = "framearray:"  # of the names of slots, which are symbols of machine code
_KINDS = {None: types.none, int: types.int64, bool: types.boolean}

# A kernel for arguments of some types: its module, its name, the types, and the type of its result.
Callee: TypeAlias = tuple[str, str, tuple[Any, ...], Any]


class _Slot(NamedTuple):
    """The address of a callee's code, None until it is there."""

    address: ctypes.c_void_p
    callee: Callee


_slots: dict[str, _Slot] = {}  # by name
_kernels: dict[tuple[str, str], Any] = {}  # that kernels may call, by module and name


def file_name(function: Any, args: tuple[Any, ...]) -> str | None:
    """Return a name for a function and arguments of some types; None for a function without a source file."""
    module = function.__module__ or ""
    total = hashlib.sha256("\0".join((module, function.__qualname__, str(args))).encode())
    if module.partition(".")[0] != _PACKAGE:
        source = Path(function.__code__.co_filename)
        if not source.is_file():
            return None
        total.update(source.read_bytes())
    total.update(serialize.dumps(tuple(cell.cell_contents for cell in function.__closure__ or ())))
    return f"{module.rpartition('.')[2]}.{function.__name__}-{total.hexdigest()[:16]}"


def call_by_address(kernel: Any) -> None:
    """Have kernels call a declared kernel by its address."""
    function, of_types, usual = kernel.py_func, kernel.get_call_template, kernel.get_overload
    returned = _kind_of(function.__annotations__.get("return", ...))
    _kernels[function.__module__, function.__qualname__] = kernel
    implemented: set[str] = set()

    def template(args: Any, kws: Any) -> Any:
        pysig, kinds = kernel._compiler.fold_argument_types(args, kws)
        name = file_name(function, kinds)
        if name is None:
            return of_types(args, kws)
        result = returned
        if result is None:  # no annotation that numba is sure to agree with
            kernel.compile(kinds)
            result = kernel.overloads[kinds].signature.return_type
        _open_slot(_PREFIX + name, (function.__module__, function.__qualname__, kinds, result))
        own, signature = function.__name__, templates.signature(result, *kinds)
        return templates.make_concrete_template(own, own, [signature]), pysig, kinds, {}

    def overload(args: Any) -> Any:
        """Return numba's key of the code that calls the kernel."""
        name = file_name(function, args)
        if name is None:
            return usual(args)
        if name not in implemented:
            implemented.add(name)
            kernel.targetctx.insert_func_defn([(_call_at(_PREFIX + name), _PREFIX + name, args)])
        return _PREFIX + name

    kernel.get_call_template, kernel.get_overload = template, overload


def _kind_of(annotation: Any) -> Any:
    """Return the type of what a kernel returns, None if its annotation leaves the number of bits open."""
    if get_origin(annotation) is tuple:
        parts = [_kind_of(part) for part in get_args(annotation)]
        return None if None in parts else types.Tuple(parts)
    return _KINDS.get(annotation)


def _open_slot(name: str, callee: Callee) -> None:
    """Make a slot that machine code knows by its name, unless there is one."""
    if name not in _slots:
        _slots[name] = _Slot(ctypes.c_void_p(), callee)
        binding.add_symbol(name, ctypes.addressof(_slots[name].address))


def _call_at(name: str) -> Callable[..., Any]:
    """Call the code whose address is in a slot."""

    def call(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        kind = context.call_conv.get_function_type(sig.return_type, sig.args).as_pointer()
        slot = builder.module.globals.get(name) or ir.GlobalVariable(builder.module, kind, name)
        status, found = context.call_conv.call_function(builder, builder.load(slot), sig.return_type, sig.args, args)
        with cgutils.if_unlikely(builder, status.is_error):
            context.call_conv.return_status_propagate(builder, status)
        return found

    return call


def callees_in(library: Any) -> list[tuple[str, Callee]]:
    """Return the slots that a kernel reads, by its library of numba's."""
    names = [variable.name for variable in library._final_module.global_variables]
    return [(name, _slots[name].callee) for name in names if name in _slots]


def open_slots(callees: Iterable[tuple[str, Callee]]) -> None:
    """Make the slots that a kernel from disk reads."""
    for name, callee in callees:
        _kernels[callee[:2]]  # there is such a kernel
        _open_slot(name, callee)


def fill_slots(callees: Iterable[tuple[str, Callee]]) -> None:
    """Load or compile what a kernel calls; the caller holds numba's lock.

    Raises:
        KernelTakenError: another process compiles one of them, and this one must not wait.
    """
    busy = []
    for name, callee in callees:
        try:
            with without_waiting():
                _fill(_slots[name].address, callee)
        except KernelTakenError:
            busy.append((name, callee))
    for name, callee in busy:
        _fill(_slots[name].address, callee)


def _fill(address: ctypes.c_void_p, callee: Callee) -> None:
    if address.value is None:
        module, function, args, result = callee
        kernel = _kernels[module, function]
        kernel.compile(args)
        made = kernel.overloads[args]
        if made.signature.return_type != result:
            raise TypeError(f"{module}.{function}: returns {made.signature.return_type}, its annotation {result}")
        address.value = made.library.get_pointer_to_function(made.fndesc.llvm_func_name)
