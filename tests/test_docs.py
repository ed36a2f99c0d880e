"""README and docs/: every link, file, target, job, command and reference in them exists, and README's example runs."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from support import ROOT, tiny
from support.scenes import Glb
from typer.testing import CliRunner

from framearray_cli.array.images import read_codes
from framearray_cli.array.manifest import image_path, layers_path
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.cli.main import app

DOCS = ROOT / "docs"
PACKAGE = ROOT / "framearray_cli"
PAGES = (ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted(DOCS.rglob("*.md")))
ROOMS = ("start", "guide", "reference", "method", "quality", "develop", "decisions")
# [text](place), [text](place "title"), [name]: place, <a href="place">, <img src="place">
LINK = re.compile(
    r"\]\(<?([^)\s>]+)>?(?:\s+\"[^\"]*\")?\)|^\[[^\]]+\]: +(\S+)|\b(?:href|src)=\"([^\"]+)\"", re.MULTILINE
)
TITLE = re.compile(r"^#+ (.*)$", re.MULTILINE)
FENCED = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
KEY = re.compile(r"\[(FA|[A-Z][a-z]+[0-9]{2})(?: [a-z]+\.? [0-9.]+)?\]")


def text(page: Path) -> str:
    return page.read_text(encoding="utf-8")


def prose(page: Path) -> str:
    """A page without its fenced blocks."""
    return FENCED.sub("", text(page))


def links(page: Path) -> list[str]:
    found = ["".join(groups) for groups in LINK.findall(prose(page))]
    return [link for link in found if not re.match(r"[a-z]+:", link)]


def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings, as GitHub makes them."""
    names = [re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in TITLE.findall(prose(page))]
    return {f"{name}-{n}" if (n := names[:i].count(name)) else name for i, name in enumerate(names)}


def broken_links(page: Path) -> list[str]:
    """Relative links of a page that lead to no file, or to no heading of it."""
    broken = []
    for link in links(page):
        name, _, anchor = link.partition("#")
        target = (page.parent / name).resolve() if name else page
        if not target.is_file() or (anchor and anchor not in anchors(target)):
            broken.append(link)
    return broken


def test_links_lead_somewhere():
    assert {str(page.relative_to(ROOT)): broken for page in PAGES if (broken := broken_links(page))} == {}


def test_a_broken_link_is_found(tmp_path: Path):
    page = tmp_path / "page.md"
    page.write_text(
        "# A `b` c\n[x](other.md) ![y](y.png)\n```\n[no](link.md)\n```\n[z](https://a.b) [w](page.md#b)\n"
        '## B\n[v](#b-1) <img src="v.svg">\n[u]: u.md\n## B\n[t](page.md "Title") [![s](s.png)](page.md#a-b-c)\n',
        encoding="utf-8",
    )
    found = ["other.md", "y.png", "page.md#b", "#b-1", "v.svg", "u.md", "page.md", "s.png", "page.md#a-b-c"]
    assert links(page) == found
    assert anchors(page) == {"a-b-c", "b", "b-1"}
    assert broken_links(page) == ["other.md", "y.png", "v.svg", "u.md", "s.png"]
    page.write_text("# A\n[b](#b) [c](../nowhere/page.md#a)\n", encoding="utf-8")
    assert broken_links(page) == ["#b", "../nowhere/page.md#a"]


def test_the_index_lists_every_page():
    index = DOCS / "index.md"
    listed = {(DOCS / link.partition("#")[0]).resolve() for link in links(index)}
    pages = {page for page in PAGES if page.parent != ROOT}
    assert pages - listed - {index} == set()
    assert {page.parent for page in pages - {index}} == {DOCS / room for room in ROOMS}


def test_every_page_and_picture_is_reachable_from_the_index():
    reached, todo = set(), [DOCS / "index.md"]
    while todo:
        page = todo.pop()
        if page in reached:
            continue
        reached.add(page)
        if page.suffix == ".md":
            todo += [(page.parent / link.partition("#")[0]).resolve() for link in links(page) if link[0] != "#"]
    files = {file for file in DOCS.rglob("*") if file.is_file()}
    assert files - reached == set()
    assert {file.suffix for file in files} == {".md", ".csv", ".json", ".jpg", ".svg", ".ipynb"}, "no scripts in docs/"


def test_pictures_are_small():
    sizes = {file.name: file.stat().st_size for file in (DOCS / "pictures").iterdir()}
    assert max(sizes.values()) <= 150_000, sizes
    assert sum(sizes.values()) < 2_000_000


def test_make_targets_exist():
    targets = set(re.findall(r"^([a-z0-9-]+):", text(ROOT / "Makefile"), re.MULTILINE))
    for page in PAGES:
        found = re.findall(r"(?:`|^)make ([a-z0-9-]+)", text(page), re.MULTILINE)
        assert set(found) <= targets, page
    named = set(re.findall(r"`make ([a-z0-9-]+)`", text(DOCS / "develop" / "contributing.md")))
    assert named | {"help"} == targets, "docs/develop/contributing.md names every target"


def test_commands_exist():
    commands = {command.callback.__name__ for command in app.registered_commands if command.callback}
    for page in PAGES:
        shown = "\n".join(f"`{line}" for _, block in FENCED.findall(text(page)) for line in block.splitlines())
        found = re.findall(r"(?:`|^    )framearray ([a-z]+)", f"{prose(page)}\n{shown}", re.MULTILINE)
        assert set(found) <= commands, page
    assert commands <= set(re.findall(r"`framearray ([a-z]+)`", text(ROOT / "CHANGELOG.md")))


def test_named_files_exist():
    """Jobs, files of the package and tests that a page names, and pages that code names."""
    place = re.compile(r"\b((?:jobs|framearray|framearray_cli|tests|docs|contrib)/[\w./-]*[\w/])")
    missing = []
    for page in (*PAGES, *PACKAGE.rglob("*.py"), *ROOT.glob("framearray/*.py"), *ROOT.glob("jobs/*.toml")):
        for name in place.findall(text(page)):
            if not (ROOT / name).exists():
                missing.append(f"{page.relative_to(ROOT)}: {name}")
    assert not missing


def test_pages_that_tests_and_tools_name_exist():
    place = re.compile(r"\bdocs/[\w./*-]*[\w/]")
    files = (ROOT / "Makefile", *ROOT.glob("tests/**/*.py"), *PACKAGE.rglob("*.js"), *ROOT.glob("jobs/**/*.py"))
    named = {(file.relative_to(ROOT).as_posix(), name) for file in files for name in place.findall(text(file))}
    assert ("Makefile", "docs/quality/report-*.csv") in named
    assert sorted(pair for pair in named if not any(ROOT.glob(pair[1]))) == []


def test_references_are_listed():
    listed = re.findall(r"^\| \[(\w+)\] \|", text(DOCS / "method" / "references.md"), re.MULTILINE)
    assert len(listed) == len(set(listed))
    for file in (*PAGES, *PACKAGE.rglob("*.py")):
        assert set(KEY.findall(text(file))) <= set(listed), file


def box(file: Path) -> None:
    """Write a room of 4 x 2.5 x 6 around README's eyes and lamps, with a table."""
    corners = np.concatenate([tiny.box((-2, 0, -3), (2, 2.5, 3)), tiny.box((-0.5, 0, -0.5), (0.5, 0.7, 0.5))])
    glb = Glb()
    paint = glb.material("Paint", {"baseColorFactor": [0.8, 0.7, 0.6, 1.0]})
    glb.node(glb.mesh(paint, positions=corners.reshape(-1, 3).astype(np.float32), faces=None))
    glb.save(file)


def readme_files() -> dict[str, str]:
    """Return the files that README asks to save: name -> the TOML block after it."""
    return dict(re.findall(r"`(\w+\.toml)`[^`]*```toml\n(.*?)```", text(ROOT / "README.md"), re.DOTALL))


def readme_commands() -> list[str]:
    blocks = [block for language, block in FENCED.findall(text(ROOT / "README.md")) if language == "sh"]
    return [line for block in blocks for line in block.splitlines() if line.startswith("framearray ")]


def test_the_example_of_readme_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Save its files and run its commands, with smaller pictures."""
    files, commands = readme_files(), readme_commands()
    assert list(files) == ["room.toml", "walk.toml"]
    assert [command.split()[1] for command in commands] == ["check", "render", "render", "assemble"]
    box(tmp_path / "room.glb")
    for name, content in files.items():
        (tmp_path / name).write_text(content, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    for command in commands:
        smaller = (
            ["--set", "camera.resolution=[48, 36]", "--set", "indirect.samples=65536"] if "room.toml" in command else []
        )
        result = CliRunner().invoke(app, [*shlex.split(command)[1:], *smaller], catch_exceptions=False)
        assert result.exit_code == 0, result.output
    assert (tmp_path / "array-preview.png").is_file()
    rendered = read_manifest(tmp_path / "array")
    listed = re.findall(r"^array/(\S+)", text(ROOT / "README.md"), re.MULTILINE)
    paths = [image_path(rendered, 0, 0), image_path(rendered, 0, 1), layers_path(rendered, 0)]
    assert listed == ["manifest.toml", *(path.name for path in paths)]
    page = text(DOCS / "reference" / "manifest.md")
    assert sorted(key for key in rendered.summary if f"`summary.{key}`" not in page and f"`{key}`" not in page) == []
    images = len(list((tmp_path / "array").glob("*.png")))
    assert f"{rendered.n_cameras} x {rendered.n_lights} = {images} images" in text(ROOT / "README.md")
    first, last = (read_codes(image_path(rendered, 12, l)).astype(float) for l in (0, rendered.n_lights - 1))
    assert 20 < first.mean() < 235, "neither black nor burnt out"
    assert np.abs(first - last).mean() > 2, "the lamp moved"
    assert (tmp_path / "walk.mp4").stat().st_size > 2_000


def test_python_files_that_pages_name_exist():
    """A bare name, or the end of a path, belongs to some file of the tree."""
    files = [
        f"/{file.relative_to(ROOT).as_posix()}"
        for top in (PACKAGE, ROOT / "framearray", ROOT / "tests", ROOT / "jobs", ROOT / "contrib")
        for file in top.rglob("*.py")
    ]
    named = {(page.name, name) for page in PAGES for name in re.findall(r"[\w/]*\w\.py\b", text(page))}
    assert ("architecture.md", "framearray_cli/engine/loop.py") in named
    assert sorted(pair for pair in named if not any(file.endswith(f"/{pair[1]}") for file in files)) == []


def test_the_tour_names_functions_where_they_are():
    rows = re.findall(r"^\|[^|`]*\| (`.+) \| (`.+`) \|$", text(DOCS / "develop" / "architecture.md"), re.MULTILINE)
    assert len(rows) > 20
    missing = []
    for functions, files in rows:
        code = "\n".join(text(ROOT / file) for file in re.findall(r"`([^`]+)`", files))
        for name in re.findall(r"`([\w.]+)`", functions):
            if not all(re.search(rf"^ *(?:def|class) {part}\b", code, re.MULTILINE) for part in name.split(".")):
                missing.append((name, files))
    assert missing == []
