"""The instruction sets that kernels are compiled for."""

import os

# Names of LLVM's features, and names that people know, from the widest on.
_SETS = {"avx512f": "AVX-512", "avx2": "AVX2", "avx": "AVX", "sse4.2": "SSE4.2", "sve": "SVE", "neon": "NEON"}


def instruction_sets() -> tuple[str, ...]:
    """Return those of this processor, the widest first; empty where NUMBA_CPU_NAME names another processor."""
    from llvmlite import binding

    if os.environ.get("NUMBA_CPU_NAME"):
        return ()
    features = binding.get_host_cpu_features()
    return tuple(name for feature, name in _SETS.items() if features.get(feature))
