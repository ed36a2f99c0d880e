"""Old machine code never runs on after the source has changed."""

import errno
import os
from pathlib import Path
from typing import Any

import numba
import pytest

from framearray_cli import kernelcache


@pytest.fixture
def cache_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty place for caches; numba's own setting is put back afterwards."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setattr(numba.config, "CACHE_DIR", "before")
    monkeypatch.setattr(kernelcache, "_problems", [])
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
    assert kernelcache.use_own_cache()
    assert numba.config.CACHE_DIR == "before" and not list(cache_home.iterdir())
    assert not kernelcache.problem()


@pytest.mark.skipif(os.name == "nt", reason="the place of caches is set by XDG_CACHE_HOME elsewhere only")
def test_where_the_users_folder_cannot_be_used_it_is_one_beside_the_source(
    cache_home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Never numba's own places: those do not change when another file of the source does."""
    package = tmp_path / "package"
    package.mkdir()
    monkeypatch.setattr(kernelcache, "__file__", str(package / "kernelcache.py"))
    cache_home.write_text("in the way")
    assert kernelcache.use_own_cache()
    assert str(package / "__pycache__" / "framearray" / kernelcache.source_digest(package)) == numba.config.CACHE_DIR
    assert not kernelcache.problem(), "nothing that a user need know"
    (package / "__pycache__" / "framearray").rename(tmp_path / "moved")
    (package / "__pycache__" / "framearray").write_text("in the way, too")
    assert not kernelcache.use_own_cache()
    assert numba.config.CACHE_DIR == ""
    assert kernelcache.problem().startswith(f"{cache_home}{os.sep}")


def test_a_choice_that_cannot_be_used_is_told(cache_home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (cache_home.parent / "file").write_text("")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(cache_home.parent / "file"))
    assert kernelcache.use_own_cache()
    assert kernelcache.problem().startswith(str(cache_home.parent / "file"))
    assert numba.config.CACHE_DIR != "before"


def compiled(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """A function that numba keeps in a folder."""
    kernelcache.use_own_cache()
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(folder))
    return numba.njit(cache=True)(doubled)


def doubled(x: int) -> int:
    return 2 * x


def test_a_kernel_that_cannot_be_kept_runs_all_the_same(cache_home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    function = compiled(cache_home.parent / "cache", monkeypatch)

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(function._cache._cache_file, "save", full)
    assert function(21) == 42
    assert kernelcache.problem().endswith(": No space left on device")


@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
def test_a_damaged_kernel_is_compiled_again(suffix: str, cache_home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As a power cut may leave it: of the right length, and empty."""
    folder = cache_home.parent / "cache"
    assert compiled(folder, monkeypatch)(21) == 42
    (file,) = folder.rglob(f"*.{suffix}")
    file.write_bytes(bytes(file.stat().st_size))
    damaged = compiled(folder, monkeypatch)
    assert damaged(21) == 42 and damaged.stats.cache_hits == {}
    again = compiled(folder, monkeypatch)
    assert again(21) == 42 and sum(again.stats.cache_hits.values()) == 1, "it was written anew"
