"""Folders that appear whole or not at all: what remains if the last steps fail or are interrupted."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from support import handmade
from support.boxarrays import plain_manifest, write_array
from support.making import export_array

from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import whole_folder
from framearray_cli.base.platform import Stopped
from framearray_cli.tools.view.pagefiles import write_page
from framearray_cli.tools.view.show import open_tiles

FAILURES = [OSError(5, "Input/output error"), KeyboardInterrupt(), SystemExit(1), Stopped(15)]


def page(tmp_path: Path) -> Callable[[Path], Any]:
    handmade.plain(tmp_path / "out", n_c=2, n_l=2, layers=False)
    tiles = open_tiles(tmp_path / "out", None, 1)
    return lambda target: write_page(tiles, target, threads=1, progress=lambda n: None)


def nerfstudio(tmp_path: Path) -> Callable[[Path], Any]:
    array = write_array(plain_manifest(tmp_path / "out"))
    return lambda target: export_array(array.directory, target, "nerfstudio", cameras="0,1", force=True)


def one_file(tmp_path: Path) -> Callable[[Path], Any]:
    (tmp_path / "out").mkdir()

    def write(target: Path) -> None:
        with whole_folder(target, replace=True) as part:
            (part / "new").write_text("new")

    return write


WRITERS = [page, nerfstudio, one_file]


def fail_at(monkeypatch: pytest.MonkeyPatch, wanted: int, failure: BaseException, *, done: bool) -> None:
    """Make one rename of a folder fail.

    Args:
        wanted: number of the rename, from 1.
        done: rename first and fail then, as a signal does.
    """
    count = 0

    def patched(real: Callable[..., None]) -> Callable[..., None]:
        def rename(source: Any, target: Any) -> None:
            nonlocal count
            count += os.path.isdir(source)
            fails = os.path.isdir(source) and count == wanted
            if done or not fails:
                real(source, target)
            if fails:
                raise failure

        return rename

    monkeypatch.setattr(os, "rename", patched(os.rename))
    monkeypatch.setattr(os, "replace", patched(os.replace))


def expected(failure: BaseException) -> type[BaseException]:
    return OutputError if isinstance(failure, OSError) else type(failure)


def content(folder: Path) -> dict[str, bytes]:
    files = (path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


@pytest.mark.parametrize("writer", WRITERS)
@pytest.mark.parametrize("failure", FAILURES, ids=lambda failure: type(failure).__name__)
@pytest.mark.parametrize(("wanted", "done"), [(1, False), (1, True), (2, False)])
def test_the_old_folder_comes_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, writer: Any, failure: BaseException, wanted: int, done: bool
) -> None:
    """The first rename fails, a signal comes between the two, or the second fails."""
    target, write = tmp_path / "x", writer(tmp_path)
    write(target)
    (target / ("transforms.json" if writer is nerfstudio else "index.json")).write_text("of the old one")
    old = content(target)
    with monkeypatch.context() as patches:
        fail_at(patches, wanted, failure, done=done)
        with pytest.raises(expected(failure)):
            write(target)
    assert content(target) == old
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out", "x"]
    write(target)
    assert content(target) != old or writer is one_file


@pytest.mark.parametrize("writer", WRITERS)
@pytest.mark.parametrize("there", [True, False])
def test_an_interrupt_after_the_last_rename_keeps_the_new_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, writer: Any, there: bool
) -> None:
    target, write = tmp_path / "x", writer(tmp_path)
    if there:
        write(target)
    fail_at(monkeypatch, 2 if there else 1, KeyboardInterrupt(), done=True)
    with pytest.raises(KeyboardInterrupt):
        write(target)
    assert content(target)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out", "x"]


@pytest.mark.parametrize("failure", FAILURES, ids=lambda failure: type(failure).__name__)
@pytest.mark.parametrize("there", [True, False])
def test_a_failure_while_the_folder_is_written_leaves_nothing(
    tmp_path: Path, failure: BaseException, there: bool
) -> None:
    if there:
        (tmp_path / "x").mkdir()
        (tmp_path / "x" / "old").write_text("old")
    with pytest.raises(expected(failure)), whole_folder(tmp_path / "x", replace=True) as part:
        (part / "new").write_text("new")
        raise failure
    assert content(tmp_path) == ({"x/old": b"old"} if there else {})
    assert [path.name for path in tmp_path.iterdir()] == (["x"] if there else [])


def test_only_an_empty_folder_gives_way_unless_replaced(tmp_path: Path) -> None:
    """Also where another program put a file into it meanwhile."""
    (tmp_path / "x").mkdir()
    with pytest.raises(OutputError, match="x: cannot be written: "), whole_folder(tmp_path / "x", replace=False):
        (tmp_path / "x" / "mine").write_text("mine")
    assert content(tmp_path) == {"x/mine": b"mine"}
    (tmp_path / "x" / "mine").unlink()
    with whole_folder(tmp_path / "x", replace=False) as part:
        (part / "new").write_text("new")
    assert content(tmp_path) == {"x/new": b"new"}
    assert [path.name for path in tmp_path.iterdir()] == ["x"]
