"""The processor that kernels are compiled for, and its instruction sets."""

import os
import platform
from contextlib import suppress
from functools import cache
from pathlib import Path

# LLVM's features, and the usual names of the sets, from the widest on.
_SETS = {"avx512f": "AVX-512", "avx2": "AVX2", "avx": "AVX", "sse4.2": "SSE4.2", "sve": "SVE", "neon": "NEON"}
# On processors that Linux guards against Downfall, gather instructions take ten times as long.
_GUARD = Path("/sys/devices/system/cpu/vulnerabilities/gather_data_sampling")


def target() -> str:
    """Return LLVM's name of the processor that kernels are compiled for, such as x86-64-v3."""
    from llvmlite import binding

    from . import start

    return start.TARGET or str(binding.get_host_cpu_name())


def processor() -> str:
    """Name the system and processor that kernels are compiled for; kernels for another one round differently."""
    return f"{platform.system()} {platform.machine()} {target()}"


def machine() -> str:
    """Describe all of this machine that machine code depends on: system, processor and instructions."""
    from llvmlite import binding
    from numba.core import codegen

    from . import start

    features = codegen.get_host_cpu_features() if start.FEATURES is None else start.FEATURES
    return f"{binding.get_process_triple()} {target()} {features}"


def host() -> str:
    """Name the system and the processor of this machine, whatever kernels are compiled for."""
    from llvmlite import binding

    return f"{platform.system()} {platform.machine()} {binding.get_host_cpu_name()}"


def instruction_sets() -> tuple[str, ...]:
    """Return the sets of this machine's processor, the widest first."""
    from llvmlite import binding

    features = binding.get_host_cpu_features()
    return tuple(name for feature, name in _SETS.items() if features.get(feature))


def has_instructions(feature: str) -> bool:
    """Return True if the processor that kernels are compiled for is known to have a feature of LLVM."""
    from llvmlite import binding

    from .start import LEVELS, instructions_of

    name = target()
    if name in LEVELS:
        return feature in instructions_of(name)
    return name == binding.get_host_cpu_name() and bool(binding.get_host_cpu_features().get(feature))


def converts_halves() -> bool:
    """Return True if the processor that kernels are compiled for has an instruction from float32 to halves."""
    return has_instructions("f16c") or platform.machine() in ("aarch64", "arm64")


@cache
def slow_gathers() -> bool:
    """Return True if gather instructions are slower than single loads on this machine; kernels then avoid them.

    FRAMEARRAY_GATHERS, "slow" or "fast", says so of another machine, for which a wheel is built.
    """
    if chosen := os.environ.get("FRAMEARRAY_GATHERS"):
        return chosen == "slow"
    with suppress(OSError):
        return "Mitigation" in _GUARD.read_text()
    return False
