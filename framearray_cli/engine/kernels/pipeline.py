"""Translate functions of kernels for LLVM, once per process and types, without machine code of their own."""

from collections.abc import Callable
from typing import Any

from numba.core import codegen, compiler
from numba.core.cpu import CPUTargetOptions
from numba.core.registry import cpu_target

# Parts of numba without type annotations.
_Library: Any = codegen.JITCodeLibrary
_Flags: Any = compiler.Flags
_compile: Any = compiler.compile_extra
_options: Any = CPUTargetOptions


class _PartLibrary(_Library):  # type: ignore[misc]
    """Code for LLVM, which kernels link; numba would optimize it and generate machine code."""

    def finalize(self) -> None:
        for library in self._linking_libraries:
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._finalized = True


def translate(function: Callable[..., Any], types: tuple[Any, ...], typingctx: Any, options: dict[str, Any]) -> Any:
    """Return numba's result of compiling a function for arguments of some types, whose library kernels link.

    Args:
        options: of `numba.njit`.
    """
    target, flags = cpu_target.target_context, _Flags()
    _options.parse_as_flags(flags, options)
    flags.no_compile = flags.no_cpython_wrapper = flags.no_cfunc_wrapper = True
    library = _PartLibrary(target.codegen(), function.__qualname__)
    return _compile(typingctx, target, function, types, None, flags, {}, library=library)
