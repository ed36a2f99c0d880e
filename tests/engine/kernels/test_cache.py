"""Machine code is never reused after the source has changed, and importing the package writes nothing."""

import errno
import os
import shutil
from pathlib import Path
from typing import Any

import pytest
from support.program import python

import framearray_cli
from framearray_cli.engine.kernels import cache as kernelcache
from framearray_cli.engine.kernels import processor
from framearray_cli.engine.kernels.kernel import kernel
from framearray_cli.engine.kernels.machine_code import keep_on_disk

PACKAGE = Path(framearray_cli.__file__).parent
elsewhere = pytest.mark.skipif(os.name == "nt", reason="the place of caches is set by XDG_CACHE_HOME elsewhere only")


@pytest.fixture
def cache_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """An empty folder for caches; later tests find theirs again."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setattr(kernelcache, "_problems", [])
    kernelcache.kernel_folder.cache_clear()
    kernelcache.ready_folder.cache_clear()
    yield tmp_path / "framearray"
    kernelcache.kernel_folder.cache_clear()
    kernelcache.ready_folder.cache_clear()


def test_any_change_of_a_file_changes_the_digest(tmp_path: Path) -> None:
    folder = tmp_path / "engine" / "terms"
    folder.mkdir(parents=True)
    (tmp_path / "engine" / "a.py").write_text("1")
    (folder / "b.py").write_text("2")
    first = kernelcache.source_digest(tmp_path)
    assert kernelcache.source_digest(tmp_path) == first
    (folder / "b.py").write_text("3")
    second = kernelcache.source_digest(tmp_path)
    (folder / "b.py").rename(folder / "c.py")
    assert len({first, second, kernelcache.source_digest(tmp_path)}) == 3


def test_an_edit_changes_the_digest_in_files_that_kernels_can_see_and_in_no_other(tmp_path: Path) -> None:
    """An edit of a message in `cli` compiles no kernel."""
    assert kernelcache.package_folder() == PACKAGE
    copy = tmp_path / "package"
    shutil.copytree(PACKAGE, copy, ignore=lambda folder, names: {"__pycache__"} & set(names))
    seen = {file for files in kernelcache.SEEN for file in copy.glob(files)}
    last_of_each_folder = {file.parent: file for file in sorted(copy.rglob("*.py"))}.values()
    digest, changed = kernelcache.source_digest(copy), set[Path]()
    for file in {*last_of_each_folder, *seen}:
        with file.open("a") as opened:
            opened.write("# changed")
        before, digest = digest, kernelcache.source_digest(copy)
        if digest != before:
            changed.add(file)
    assert changed == seen


def test_the_digest_changes_with_all_that_machine_code_depends_on(monkeypatch: pytest.MonkeyPatch) -> None:
    digests = [kernelcache.source_digest(PACKAGE)]
    for name, value in (
        ("framearray_cli.engine.kernels.cache.slow_gathers", lambda: not processor.slow_gathers()),
        ("framearray_cli.engine.embree.library.packet_width", lambda: 5),
        ("framearray_cli.engine.kernels.start.TARGET", "x86-64"),
        ("framearray_cli.engine.kernels.start.FEATURES", "+sse3"),
        ("numba.__version__", "0.1"),
        ("sys.implementation.cache_tag", "cpython-39"),
    ):
        monkeypatch.setattr(name, value)
        digests.append(kernelcache.source_digest(PACKAGE))
    assert len(set(digests)) == len(digests)


@pytest.mark.parametrize(
    ("text", "slow"), [("Mitigation: Microcode", True), ("Not affected", False), ("Vulnerable", False), (None, False)]
)
def test_gathers_are_slow_where_the_processor_is_guarded(
    text: str | None, slow: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if text is not None:
        (tmp_path / "guard").write_text(text)
    monkeypatch.setattr(processor, "_GUARD", tmp_path / "guard")
    assert processor.slow_gathers.__wrapped__() is slow


IMPORTS = """
import importlib, pathlib, sys
from numba.core import caching
from numba import config
classes = [c for c in vars(caching).values() if isinstance(c, type)]
def state():
    settings = {name: str(value) for name, value in vars(config).items() if name not in ("CPU_NAME", "CPU_FEATURES")}
    return [dict(vars(c)) for c in classes], settings
before, imported = state(), []
package = pathlib.Path(sys.argv[1])
for file in sorted(package.rglob("*.py")):
    if "kernel import" in (text := file.read_text()) and "@kernel" in text or "@inlined" in text:
        name = ".".join(file.relative_to(package.parent).with_suffix("").parts)
        imported.append(importlib.import_module(name))
assert len(imported) > 10, imported
home = pathlib.Path(sys.argv[2])
print(state() == before, any(home.iterdir()))
from framearray_cli.engine.hits.native import pixel_order
pixel_order(4, 4)
print(state() == before, len(list(home.rglob("*.kernel"))))
"""


@elsewhere
def test_importing_kernels_makes_no_folder_and_does_not_change_numba(tmp_path: Path) -> None:
    """The first kernel that is called makes the folder; for other libraries numba changes only its processor."""
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    found = python(IMPORTS, PACKAGE, tmp_path, env=environment, XDG_CACHE_HOME=str(tmp_path))
    assert found.splitlines() == ["True False", "True 1"]


@elsewhere
def test_kernels_go_into_a_folder_of_this_source_and_old_ones_are_dropped(cache_home: Path) -> None:
    for age in range(5):
        (cache_home / f"old{age}").mkdir(parents=True)
        os.utime(cache_home / f"old{age}", (1000 - age, 1000 - age))
    own = kernelcache.source_digest(PACKAGE)
    assert kernelcache.kernel_folder() == cache_home / own
    assert {folder.name for folder in cache_home.iterdir()} == {own, "old0", "old1", "old2"}


def test_the_users_choice_stands(cache_home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Other files of the user there stay."""
    chosen = tmp_path / "chosen"
    for k in range(5):
        (chosen / f"other{k}").mkdir(parents=True)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(chosen))
    function = kernel(doubled)
    assert function(21) == 42
    (file,) = chosen.rglob("*.kernel")
    assert kernelcache.source_digest(PACKAGE) in file.parts
    assert len(list(chosen.glob("other*"))) == 5 and not cache_home.exists()
    assert not kernelcache.problem()


@elsewhere
def test_where_the_users_folder_cannot_be_used_it_is_one_beside_the_source(
    cache_home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Never in numba's own folders, which do not change when another file of the source does."""
    package = tmp_path / "package"
    package.mkdir()
    monkeypatch.setattr(kernelcache, "package_folder", lambda: package)
    cache_home.write_text("in the way")
    beside = package / "__pycache__" / "framearray"
    assert kernelcache.kernel_folder() == beside / kernelcache.source_digest(package)
    assert not kernelcache.problem(), "nothing to report to a user"
    beside.rename(tmp_path / "moved")
    beside.write_text("in the way, too")
    kernelcache.kernel_folder.cache_clear()
    assert kernelcache.kernel_folder() is None
    assert kernelcache.problem().startswith(f"{cache_home}{os.sep}")
    assert kernel(doubled)(21) == 42, "compiled all the same"


def test_a_choice_that_cannot_be_used_is_reported(cache_home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (cache_home.parent / "file").write_text("")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(cache_home.parent / "file"))
    folder = kernelcache.kernel_folder()
    assert kernelcache.problem().startswith(str(cache_home.parent / "file"))
    assert folder is not None and cache_home.parent / "file" not in folder.parents


def test_a_function_without_a_source_file_is_compiled_in_each_run(cache_home: Path) -> None:
    names: dict[str, Any] = {}
    exec("def typed_in(x): return 3 * x", names)
    assert kernel(names["typed_in"])(14) == 42
    assert not list(cache_home.rglob("*.kernel"))


def test_without_compiling_kernels_are_plain_functions() -> None:
    """As numba's own decorator leaves them with NUMBA_DISABLE_JIT."""
    assert keep_on_disk(doubled) is doubled


def doubled(x: int) -> int:
    return 2 * x


def test_a_kernel_that_cannot_be_kept_runs_all_the_same(cache_home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    function: Any = kernel(doubled)

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "write_bytes", full)
    assert function(21) == 42
    assert kernelcache.problem().endswith(": No space left on device")


def test_a_damaged_kernel_is_compiled_again(cache_home: Path) -> None:
    """As a power cut may leave it: the right length, all zeros."""
    assert kernel(doubled)(21) == 42
    (file,) = (kernelcache.kernel_folder() or cache_home).rglob("*.kernel")
    file.write_bytes(bytes(file.stat().st_size))
    damaged: Any = kernel(doubled)
    assert damaged(21) == 42 and damaged.stats.cache_hits == {}
    again: Any = kernel(doubled)
    assert again(21) == 42 and sum(again.stats.cache_hits.values()) == 1, "it was written anew"


@pytest.fixture
def package(cache_home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of ready-made kernels, with one that was compiled elsewhere; caches are empty."""
    assert kernel(doubled)(21) == 42
    copy = tmp_path / "package"
    shutil.copytree(PACKAGE, copy, ignore=lambda folder, names: {"__pycache__"} & set(names))
    compiled = kernelcache.kernel_folder()
    assert compiled is not None and kernelcache.source_digest(copy) == compiled.name
    shutil.move(compiled, copy / kernelcache.READY / compiled.name)
    monkeypatch.setattr(kernelcache, "package_folder", lambda: copy)
    kernelcache.ready_folder.cache_clear()
    kernelcache.kernel_folder.cache_clear()
    return copy


@elsewhere
def test_ready_made_kernels_are_loaded_from_the_package_and_the_users_folder_is_not_touched(
    package: Path, cache_home: Path
) -> None:
    """Whatever times its files got when they were installed."""
    for file in package.rglob("*"):
        os.utime(file, (1000, 1000))
    shutil.rmtree(cache_home)
    ready: Any = kernel(doubled)
    assert ready(21) == 42 and not cache_home.exists()
    assert sum(ready.stats.cache_hits.values()) == 1
    assert kernelcache.kept_kernels() == 1


@elsewhere
@pytest.mark.parametrize("how", ["damaged", "edited"])
def test_kernels_that_do_not_fit_are_compiled_into_the_users_folder(how: str, package: Path, cache_home: Path) -> None:
    (file,) = package.rglob("*.kernel")
    if how == "damaged":
        file.write_bytes(bytes(file.stat().st_size))
    else:
        with next(package.glob("engine/*.py")).open("a") as source:
            source.write("# changed")
    other: Any = kernel(doubled)
    assert other(21) == 42 and other.stats.cache_hits == {}
    again: Any = kernel(doubled)
    assert again(21) == 42 and sum(again.stats.cache_hits.values()) == 1
    assert len(list(cache_home.rglob("*.kernel"))) == 1
