"""Words of messages and pages: counts agree with their nouns, each thing has one name (docs/index.md)."""

import ast
import re
from collections.abc import Iterator

import pytest
from support import ROOT
from support.prose import counts_of_code, counts_of_pages

PACKAGE, PUBLIC = ROOT / "framearray_cli", ROOT / "framearray"

# Things that messages count. A number before one of these goes through `counted` or `agree`.
NOUNS = (
    "blocks|cameras|cells|chunks|columns|eyes|faces|files|frames|groups|hits|images|keys|lights|materials|normals|notes|"
    "paths|pictures|pixels|places|points|positions|problems|rays|samples|sources|steps|textures|triangles|values|walks|"
    "workers"
)
PLURAL = re.compile(rf"^ (?:[a-z]+ )?(?:{NOUNS})\b")
# Numbers that are never 1, or are no counts: bounds, sizes in pixels, means with decimals.
NO_COUNTS = (
    "GIF_",
    "LARGEST",
    "MOST_",
    "WEBP_",
    "height",
    "image.",
    "made.size[1]",
    "others[0]",
    "shape[0]",
    "size[1]",
)
# Numbers that agree already, are millions, or are no numbers.
FINE = ("list(place)", "size", "agree(", "extension", "full[1]", "packets", "spent")
NOT_READ = ("framearray_cli/engine/embree/embreescene.py",)
# Texts for people; the others are of code.
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs" / "guide").glob("*.md"))]


def strings() -> Iterator[tuple[str, ast.JoinedStr]]:
    for file in sorted([*PACKAGE.rglob("*.py"), *PUBLIC.rglob("*.py")]):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.JoinedStr):
                yield f"{file.relative_to(ROOT)}:{node.lineno}", node


def wrong_counts(node: ast.JoinedStr) -> list[str]:
    """List the numbers of an f-string before a plural that they may not agree with."""
    found = []
    for value, text in zip(node.values, node.values[1:], strict=False):
        if not (isinstance(value, ast.FormattedValue) and isinstance(text, ast.Constant)):
            continue
        number = ast.unparse(value.value)
        decimals = value.format_spec is not None and re.search(r"[fge%]", ast.unparse(value.format_spec))
        if PLURAL.match(str(text.value)) and not decimals and not number.startswith(NO_COUNTS + FINE):
            found.append(f"{{{number}}}{text.value}")
    return found


def test_wrong_counts_are_found():
    node = ast.parse("f'{n} more files, {n:.1f} hits, {MOST_EYES} eyes, {counted(n, \"file\")} left'").body[0]
    assert isinstance(node, ast.Expr) and isinstance(node.value, ast.JoinedStr)
    assert wrong_counts(node.value) == ["{n} more files, "]


def test_counts_agree_with_their_nouns():
    assert [
        f"{place}: {text}" for place, node in strings() if not place.startswith(NOT_READ) for text in wrong_counts(node)
    ] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_pages_count_positions(page):
    """An array has one camera, which has positions: nothing is counted in cameras, lights or eyes."""
    text = re.sub(r"`[^`\n]*`", "", page.read_text(encoding="utf-8"))
    assert re.findall(r"\b(?:[\d,]*\d|N_c|N_l) (?:cameras|lights|eyes)\b", text) == []


def test_nothing_has_phrases_that_the_rules_for_prose_avoid():
    """See docs/develop/contributing.md."""
    generated = {"job-file.md", "command-line.md"}
    pages = [ROOT / "README.md", *(page for page in (ROOT / "docs").rglob("*.md") if page.name not in generated)]
    for found in (counts_of_pages(pages), counts_of_code(sorted([*PACKAGE.rglob("*.py"), *PUBLIC.rglob("*.py")]))):
        assert not any(found.values()), found
