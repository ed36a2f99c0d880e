"""The processor that kernels are compiled for, and its instruction sets."""

import os
import platform
from contextlib import suppress
from functools import cache
from pathlib import Path

# LLVM's features, and the usual names of the sets, from the widest on.
_SETS = {"avx512f": "AVX-512", "avx2": "AVX2", "avx": "AVX", "sse4.2": "SSE4.2", "sve": "SVE", "neon": "NEON"}
# Instructions of named processors, of those that kernels ask for.
_OF_NAMED = {"x86-64-v3": ("avx2", "f16c"), "x86-64-v4": ("avx2", "f16c", "avx512f")}
# On processors that Linux guards against Downfall, gather instructions take ten times as long.
_GUARD = Path("/sys/devices/system/cpu/vulnerabilities/gather_data_sampling")


def processor() -> str:
    """Name the system and processor that kernels are compiled for; kernels for another one round differently."""
    from llvmlite import binding

    return f"{platform.system()} {platform.machine()} {binding.get_host_cpu_name()}"


def instruction_sets() -> tuple[str, ...]:
    """Return the sets of this processor, the widest first; empty if NUMBA_CPU_NAME names another processor."""
    from llvmlite import binding

    if os.environ.get("NUMBA_CPU_NAME"):
        return ()
    features = binding.get_host_cpu_features()
    return tuple(name for feature, name in _SETS.items() if features.get(feature))


def has_instructions(feature: str) -> bool:
    """Return True if the processor that kernels are compiled for is known to have a feature of LLVM."""
    from llvmlite import binding

    if named := os.environ.get("NUMBA_CPU_NAME"):
        return feature in _OF_NAMED.get(named, ())
    return bool(binding.get_host_cpu_features().get(feature))


def converts_halves() -> bool:
    """Return True if the processor that kernels are compiled for has an instruction from float32 to halves."""
    return has_instructions("f16c") or platform.machine() in ("aarch64", "arm64")


@cache
def slow_gathers() -> bool:
    """Return True if gather instructions are slower than single loads on this machine; kernels then avoid them."""
    with suppress(OSError):
        return "Mitigation" in _GUARD.read_text()
    return False
