"""Old machine code never runs on after the source has changed."""

import os
from pathlib import Path

import numba
import pytest

from framearray_cli import kernelcache


@pytest.fixture
def cache_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty place for caches; numba's own setting is put back afterwards."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setattr(numba.config, "CACHE_DIR", "before")
    return tmp_path / "framearray"


def test_any_change_of_any_file_changes_the_digest(tmp_path: Path) -> None:
    (tmp_path / "terms").mkdir()
    (tmp_path / "a.py").write_text("1")
    (tmp_path / "terms" / "b.py").write_text("2")
    first = kernelcache.source_digest(tmp_path)
    assert kernelcache.source_digest(tmp_path) == first
    (tmp_path / "terms" / "b.py").write_text("3")
    second = kernelcache.source_digest(tmp_path)
    (tmp_path / "terms" / "b.py").rename(tmp_path / "terms" / "c.py")
    assert len({first, second, kernelcache.source_digest(tmp_path)}) == 3


@pytest.mark.skipif(os.name == "nt", reason="the place of caches is set by XDG_CACHE_HOME elsewhere only")
def test_kernels_go_into_a_folder_of_this_source_and_old_ones_are_dropped(cache_home: Path) -> None:
    for age in range(5):
        (cache_home / f"old{age}").mkdir(parents=True)
        os.utime(cache_home / f"old{age}", (1000 - age, 1000 - age))
    kernelcache.use_own_cache()
    own = kernelcache.source_digest(Path(kernelcache.__file__).parent)
    assert str(cache_home / own) == numba.config.CACHE_DIR
    assert {folder.name for folder in cache_home.iterdir()} == {own, "old0", "old1", "old2"}


def test_the_users_choice_stands(cache_home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(cache_home))
    kernelcache.use_own_cache()
    assert numba.config.CACHE_DIR == "before" and not cache_home.exists()


@pytest.mark.skipif(os.name == "nt", reason="the place of caches is set by XDG_CACHE_HOME elsewhere only")
def test_where_no_folder_can_be_made_numba_chooses(cache_home: Path) -> None:
    cache_home.write_text("in the way")
    kernelcache.use_own_cache()
    assert numba.config.CACHE_DIR == "before"
