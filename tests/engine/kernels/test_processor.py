"""Kernels are compiled for a level of x86-64, so that machine code fits other machines."""

import os
from itertools import chain

import pytest
from llvmlite import binding
from support.program import python

from framearray_cli.engine.kernels import processor, start

HOST = binding.get_host_cpu_features()
ALL = dict.fromkeys(chain(*start.LEVELS.values()), True)
# A kernel of a process of its own: the processor that it is compiled for, and its widest registers
KERNEL = """
from framearray_cli.engine.kernels.kernel import kernel
from framearray_cli.engine.kernels.processor import target
from numba.core.registry import cpu_target
import numpy as np
def double(a):
    for i in range(len(a)):
        a[i] *= 2
double(np.ones(64, np.float32))
compiled = kernel(double)
compiled(np.ones(64, np.float32))
assembly = compiled.inspect_asm(compiled.signatures[0])
print(target(), cpu_target.target_context.codegen().magic_tuple()[1:], "zmm" in assembly, "ymm" in assembly)
"""


@pytest.mark.parametrize(
    ("missing", "level"),
    [(None, "x86-64-v4"), ("avx512vl", "x86-64-v3"), ("avx512f", "x86-64-v3"), ("fma", None), ("avx2", None)],
)
def test_a_processor_is_of_the_highest_level_whose_instructions_it_has(missing: str | None, level: str | None) -> None:
    assert start.level_of({name: name != missing for name in ALL}) == level


def test_other_processors_have_no_level() -> None:
    assert start.level_of({"neon": True, "sve": True}) is None
    assert start.level_of({}) is None


def compiled(**settings: str) -> str:
    environment = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_CPU")}
    return python(KERNEL, env=environment, **settings)


def test_kernels_are_compiled_for_the_level_of_this_processor() -> None:
    level = start.level_of(HOST)
    if level is None:
        pytest.skip("this processor has no level of x86-64")
    assert compiled().startswith(f"{level} ('{level}', '') ")


@pytest.mark.skipif(not HOST.get("avx2"), reason="this processor has no AVX2")
def test_a_level_that_the_user_names_has_no_instructions_beyond() -> None:
    assert compiled(NUMBA_CPU_NAME="x86-64-v3") == "x86-64-v3 ('x86-64-v3', '') False True"


def test_another_processor_that_the_user_names_keeps_its_name() -> None:
    name, features = binding.get_host_cpu_name(), HOST.flatten()
    assert compiled(NUMBA_CPU_NAME=name).startswith(f"{name} ('{name}', '{features}') ")


def test_reports_name_both_processors(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(start, "TARGET", "x86-64-v3")
    assert processor.processor().endswith(" x86-64-v3")
    assert processor.host().endswith(f" {binding.get_host_cpu_name()}")
