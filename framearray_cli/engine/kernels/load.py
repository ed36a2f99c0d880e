"""Load the machine code of a kernel from disk, without what numba needs only to compile.

numba prepares to compile before it looks for machine code, and reads the code that other functions would inline. Both
take longer than the loading itself. Here both wait until something is compiled.
"""

from contextlib import AbstractContextManager, suppress
from typing import Any

from llvmlite import binding
from numba.core import caching, codegen

from .cache import forgive
from .start import is_tried

# Parts of numba without type annotations.
_Files: Any = caching.CompileResultCacheImpl
_FunctionCache: Any = caching.FunctionCache
_Library: Any = codegen.JITCodeLibrary


class _LazyLibrary(_Library):  # type: ignore[misc]  # numba has no annotations
    """Machine code from disk; the code that other functions inline is read when one of them is compiled.

    Until then numba knows none of its symbols.
    """

    _unread: tuple[bytes, bytes] | None = None  # machine code, code to inline
    _module: Any = None

    @classmethod
    def _unserialize(cls, codegen: Any, state: tuple[str, str, Any]) -> Any:
        name, kind, stored = state
        if kind != "object":
            return super()._unserialize(codegen, state)
        made = codegen.create_library(name)
        made.enable_object_caching()
        made._set_compiled_object(stored[0])
        made._unread = stored
        made._finalize_final_module()
        return made

    def get_pointer_to_function(self, name: str) -> Any:
        """Return the address of a function, 0 if there is none of that name."""
        if self._unread is None:
            return super().get_pointer_to_function(name)
        there = name.encode() + b"\0" in self._unread[0]  # in its table of symbols
        return self._codegen._engine.get_function_address(name) if there else 0

    @property
    def _shared_module(self) -> Any:
        if self._unread is not None:
            self._module, self._unread = binding.parse_bitcode(self._unread[1]), None
            self._codegen._engine._load_defined_symbols(self._module)
        return self._module

    @_shared_module.setter
    def _shared_module(self, module: Any) -> None:
        self._module = module


class KernelFiles(_Files):  # type: ignore[misc]  # numba has no annotations
    """numba's files of a function, read with `_LazyLibrary`."""

    def rebuild(self, context: Any, stored: Any) -> Any:
        """Return the machine code of stored data; the caller holds numba's lock."""
        if not is_tried():
            return super().rebuild(context, stored)
        generator = context.codegen()
        generator._library_class = _LazyLibrary
        try:
            return super().rebuild(context, stored)
        finally:
            with suppress(AttributeError):
                del generator._library_class  # that of numba's own class again


class KernelCache(_FunctionCache):  # type: ignore[misc]  # numba has no annotations
    """numba's cache of a function; where that fails, numba compiles."""

    def load_overload(self, signature: Any, context: Any) -> Any:
        """Return the machine code for a signature, or None; as numba does, but without preparing to compile."""
        if not is_tried():
            return super().load_overload(signature, context)
        with forgive(self):
            return self._load_overload(signature, context)

    def _guard_against_spurious_io_errors(self) -> AbstractContextManager[None]:
        return forgive(self)
