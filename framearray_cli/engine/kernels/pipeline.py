"""The passes by which numba compiles kernels: its own, except for the one that inlines.

A file of its own because it is loaded only to compile, and takes half as long as all the rest of numba.

numba analyses an inlined function anew at every call, with all functions that are inlined into it, and copies its code
twice, object by object; that was a quarter of the time that kernels took to compile. Here each inlined function is
analysed once per process, and each call makes one copy.
"""

from collections.abc import Callable
from copy import copy
from typing import Any

from numba.core import compiler, compiler_machinery, inline_closurecall, ir, untyped_passes

from .start import is_tried

# Parts of numba without type annotations, so mypy ignores that classes derive from them.
_Builder: Any = compiler.DefaultPassBuilder
_Inlining: Any = untyped_passes.InlineInlinables
_Worker: Any = inline_closurecall.InlineWorker
_Block: Any = ir.Block
_Scope: Any = ir.Scope
_Variable: Any = ir.Var
_register: Any = compiler_machinery.register_pass
_NODES: Any = (ir.Inst, ir.AbstractRHS)  # statements and expressions
_SHARED: Any = (ir.Const, ir.Global, ir.FreeVar)  # expressions that never change

# Inlined functions and their code, which must not be changed.
_analysed: dict[Callable[..., Any], Any] = {}


def kernel_pipeline(state: Any) -> Any:
    """Return numba's passes, with faster inlining."""
    passes = _Builder.define_nopython_pipeline(state)
    return _replace_inlining(passes) if is_tried() else passes


def _untyped_pipeline(state: Any) -> Any:
    """Return the passes that analyse an inlined function."""
    return _replace_inlining(_Builder.define_untyped_pipeline(state))


def _replace_inlining(passes: Any) -> Any:
    passes.passes = [(_FastInlining if made is _Inlining else made, name) for made, name in passes.passes]
    return passes


@_register(mutates_CFG=True, analysis_only=False)
class _FastInlining(_Inlining):  # type: ignore[misc]
    """numba's pass, with a worker of our own."""

    def _do_work(self, state: Any, work_list: Any, block: Any, i: int, call: Any, worker: Any) -> Any:
        worker.__class__, worker._compiler_pipeline = _FastWorker, _untyped_pipeline
        return super()._do_work(state, work_list, block, i, call, worker)


class _FastWorker(_Worker):  # type: ignore[misc]
    """Replaces calls by the code of the function that they call."""

    def run_untyped_passes(self, function: Callable[..., Any], enable_ssa: bool = False) -> Any:
        if function not in _analysed:
            _analysed[function] = super().run_untyped_passes(function, enable_ssa)
        return _analysed[function]

    def inline_ir(self, caller: Any, block: Any, i: int, callee: Any, *args: Any, **more: Any) -> Any:
        inlined = super().inline_ir(caller, block, i, _copied(callee), *args, **more)
        for made in inlined[1].values():
            made.__class__ = _Block
        return inlined


class _OwnBlock(_Block):  # type: ignore[misc]
    """A block of a copy for one call, of which numba needs no other copy."""

    def __deepcopy__(self, memo: Any) -> "_OwnBlock":
        return self


def _copied(code: Any) -> Any:
    """Copy the code of a function: blocks, statements, expressions and variables."""
    scope = next(iter(code.blocks.values())).scope
    own_scope = _Scope(scope.parent, scope.loc)
    own_scope.redefined.update(scope.redefined)
    own_scope.var_redefinitions.update({name: set(names) for name, names in scope.var_redefinitions.items()})
    variables: dict[int, Any] = {}

    def variable(old: Any) -> Any:
        if id(old) not in variables:
            variables[id(old)] = _Variable(own_scope, old.name, old.loc)
        return variables[id(old)]

    def part(old: Any) -> Any:
        kind: Any = type(old)
        if kind is _Variable:
            return variable(old)
        if kind is list or kind is tuple:
            return kind([part(value) for value in old])
        if kind is dict:
            return {key: part(value) for key, value in old.items()}
        if not isinstance(old, _NODES) or kind in _SHARED:
            return old
        new = object.__new__(kind)
        new.__dict__.update({name: part(value) for name, value in old.__dict__.items()})
        return new

    for name, old in scope.localvars._con.items():
        own_scope.localvars.define(name, variable(old))
    own = copy(code)
    own.blocks = {}
    for label, block in code.blocks.items():
        own.blocks[label] = _OwnBlock(own_scope, block.loc)
        own.blocks[label].body = [part(statement) for statement in block.body]
    return own
