"""numba's compiler with the passes that kernels need, and parts of kernels, translated once per process and types."""

from . import start  # isort: skip  # before any of numba

import gc
import operator
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

from numba import extending
from numba.core import codegen, compiler, typed_passes, types, untyped_passes
from numba.core.base import BaseContext
from numba.core.compiler_machinery import PassManager
from numba.core.cpu import CPUTargetOptions
from numba.core.registry import cpu_target
from numba.core.targetconfig import TargetConfig


class Pipeline(compiler.CompilerBase):
    """Compile without passes for closures, `with`, lists of types, arrays in expressions and parallel loops.

    Each pass analyses the whole function anew, which takes a tenth of the time in all.
    """

    def define_pipelines(self) -> list[Any]:
        """Return the passes."""
        passes = PassManager("kernel")
        for each in (
            untyped_passes.TranslateByteCode,
            untyped_passes.FixupArgs,
            untyped_passes.IRProcessing,
            untyped_passes.RewriteSemanticConstants,
            untyped_passes.DeadBranchPrune,
            untyped_passes.GenericRewrites,
            untyped_passes.ReconstructSSA,
            untyped_passes.DeadBranchPrune,
            typed_passes.NopythonTypeInference,
            typed_passes.PreLowerStripPhis,
            typed_passes.IRLegalization,
            typed_passes.AnnotateTypes,
            typed_passes.NativeLowering,
            typed_passes.NoPythonBackend,
        ):
            passes.add_pass(each, each.__name__)
        passes.finalize()
        return [passes]


class _PartLibrary(codegen.JITCodeLibrary):
    """Code for LLVM, which kernels link; numba would optimize it and generate machine code."""

    def finalize(self) -> None:
        for library in self._linking_libraries:
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._finalized = True


def translate(
    function: Callable[..., Any], kinds: tuple[Any, ...], typingctx: Any, options: dict[str, Any], *, called: bool
) -> Any:
    """Return numba's result of compiling a function for arguments of some types, whose library kernels link.

    Args:
        options: of `numba.njit`.
        called: False if LLVM may put the function into its callers.
    """
    target, flags = cpu_target.target_context, compiler.Flags()
    CPUTargetOptions.parse_as_flags(flags, options)
    flags.no_compile = flags.no_cpython_wrapper = flags.no_cfunc_wrapper = True
    library = _PartLibrary(target.codegen(), function.__qualname__)
    made = compiler.compile_extra(
        typingctx, target, function, kinds, None, flags, {}, library=library, pipeline_class=Pipeline
    )
    if called:
        library._final_module.get_function(made.fndesc.llvm_func_name).add_function_attribute("noinline")
    return made


# Operators of Python, whose declarations numba asks one after the other for each call: of text, lists and dates too.
_OPERATORS = frozenset(getattr(operator, name) for name in operator.__all__)
_ask: Any = types.BaseFunction.get_call_type
_measure: Any = BaseContext.get_abi_sizeof
_answers: dict[Any, Any] = {}
_sizes: dict[Any, Any] = {}


@cache
def _defaults(declared: Any) -> dict[str, Any]:
    return {name: option.default for name, option in declared.options.items()}


def _values(options: Any) -> Any:
    """Return all options of a function; numba reads one after the other to compare them."""
    declared: Any = type(options)
    return _defaults(declared) | options._values


def _call_type(function: Any, context: Any, args: Any, kws: Any) -> Any:
    """Return the signature of a call; of parts, and of operators but for tuples, the one that numba found before."""
    called = function.typing_key
    if kws or not (
        isinstance(called, extending._Intrinsic) or (called in _OPERATORS and not isinstance(args[0], types.BaseTuple))
    ):
        return _ask(function, context, args, kws)
    key = function, args
    if key not in _answers:
        _answers[key] = _ask(function, context, args, kws)
    return _answers[key]


def _size_of(context: Any, kind: Any) -> Any:
    """Return the bytes of an LLVM type; numba has LLVM read a module for it."""
    if kind not in _sizes:
        _sizes[kind] = _measure(context, kind)
    return _sizes[kind]


_SHORTCUTS = (
    (TargetConfig, "values", _values),
    (types.BaseFunction, "get_call_type", _call_type),
    (BaseContext, "get_abi_sizeof", _size_of),
)


@contextmanager
def shortcuts() -> Iterator[None]:
    """Compile in three quarters of the time within the block, with the same result.

    numba remembers some answers, and Python does not look for garbage again and again.
    """
    usual = [getattr(owner, name) for owner, name, _ in _SHORTCUTS]
    collects = gc.isenabled()
    gc.disable()
    if start.is_tried():
        for owner, name, shortcut in _SHORTCUTS:
            setattr(owner, name, shortcut)
    try:
        yield
    finally:
        for (owner, name, _), method in zip(_SHORTCUTS, usual, strict=True):
            setattr(owner, name, method)
        if collects:
            gc.enable()
