"""Shared by all tests; its place lets them import the helpers beside it."""

import os


def pytest_configure() -> None:
    """Force Embree to fewer instructions where `make test-avx2` asks for it."""
    if os.environ.get("FRAMEARRAY_EMBREE"):
        import instructionset

        instructionset.force_embreex()
