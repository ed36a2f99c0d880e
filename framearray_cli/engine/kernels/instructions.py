"""The instruction sets that kernels are compiled for."""

import os
import platform

# Names of LLVM's features, and names that people know, from the widest on.
_SETS = {"avx512f": "AVX-512", "avx2": "AVX2", "avx": "AVX", "sse4.2": "SSE4.2", "sve": "SVE", "neon": "NEON"}
# Instructions of named processors, of those that kernels ask for.
_OF_NAMED = {"x86-64-v3": ("avx2", "f16c"), "x86-64-v4": ("avx2", "f16c", "avx512f")}


def instruction_sets() -> tuple[str, ...]:
    """Return those of this processor, the widest first; empty where NUMBA_CPU_NAME names another processor."""
    from llvmlite import binding

    if os.environ.get("NUMBA_CPU_NAME"):
        return ()
    features = binding.get_host_cpu_features()
    return tuple(name for feature, name in _SETS.items() if features.get(feature))


def has_instructions(feature: str) -> bool:
    """Whether the processor that kernels are compiled for is known to have the instructions of a feature of LLVM."""
    from llvmlite import binding

    if named := os.environ.get("NUMBA_CPU_NAME"):
        return feature in _OF_NAMED.get(named, ())
    return bool(binding.get_host_cpu_features().get(feature))


def converts_halves() -> bool:
    """Whether an instruction of the processor that kernels are compiled for converts float32 to halves."""
    return has_instructions("f16c") or platform.machine() in ("aarch64", "arm64")
