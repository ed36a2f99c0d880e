"""The examples of docs/guide/python.md, of the docstrings and of the notebook run as they are."""

import doctest
import json
import re
from pathlib import Path

import pytest
from support.guide import DOCS, blocks
from support.public import write_job

import framearray

NOTEBOOK = DOCS / "guide/python-first-look.ipynb"
SHOWN = {"array": framearray.FrameArray, 'array.sheet(cameras="0,last", light="0,4,8,12,20", rows=5)': framearray.Sheet}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    write_job(tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_page_runs_from_top_to_bottom(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("zarr", reason="the page writes a store")
    pytest.importorskip("xarray", reason="the page opens a lazy array")
    names: dict[str, object] = {}
    for block in blocks("guide/python.md", "python"):
        exec(compile(block, "python.md", "exec"), names)
    assert re.search(r"^28 of 28, 0 s left$", capsys.readouterr().out, re.MULTILINE)
    assert (folder / "sheet.png").is_file() and (folder / "room.zarr").is_dir()
    (shown,) = blocks("../README.md", "python")
    exec(shown.replace("jobs/kitchen-evening.toml", "room.toml"), names)
    # what the first lines of the package say
    tests = doctest.DocTestFinder().find(framearray, "framearray", globs={})
    results = [doctest.DocTestRunner().run(test) for test in tests]
    assert sum(result.attempted for result in results) >= 4 and not any(result.failed for result in results)


def test_the_notebook_is_small_and_without_outputs() -> None:
    cells = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    assert all(not cell["outputs"] and cell["execution_count"] is None for cell in cells if cell["cell_type"] == "code")
    assert NOTEBOOK.stat().st_size < 20_000


@pytest.mark.slow
def test_the_cells_of_the_notebook_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In this process, which has loaded the kernels; a notebook shows the values of `SHOWN`."""
    pytest.importorskip("xarray", reason="the notebook opens a lazy array")
    monkeypatch.chdir(tmp_path)
    cells = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    code = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    names: dict[str, object] = {}
    for text in code:
        exec(compile(text, NOTEBOOK.name, "exec"), names)
    assert set(SHOWN) <= set(code)
    assert all(isinstance(eval(text, names), kind) for text, kind in SHOWN.items())


@pytest.mark.slow
def test_jupyter_runs_the_notebook(tmp_path: Path) -> None:
    nbclient = pytest.importorskip("nbclient", reason="runs notebooks")
    nbformat = pytest.importorskip("nbformat", reason="reads notebooks")
    pytest.importorskip("ipykernel", reason="runs the cells of notebooks")
    pytest.importorskip("xarray", reason="the notebook opens a lazy array")
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    nbclient.NotebookClient(notebook, timeout=600, resources={"metadata": {"path": str(tmp_path)}}).execute()
    shown = [kind for cell in notebook.cells for output in cell.get("outputs", ()) for kind in output.get("data", ())]
    assert {"text/html", "image/png"} <= set(shown), "a sheet and an array"
