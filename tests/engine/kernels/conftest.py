"""Kernels of tests that are compiled whatever is on disk."""

from pathlib import Path
from typing import Any

import pytest

from framearray_cli.engine.kernels import cache as kernelcache


@pytest.fixture
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """An empty folder for kernels; later tests find theirs again."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    kernelcache.kernel_folder.cache_clear()
    yield tmp_path
    kernelcache.kernel_folder.cache_clear()
