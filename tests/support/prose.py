"""Phrases that the rules for prose avoid (docs/develop/contributing.md), counted in code and pages."""

import ast
import io
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path

# Openings that hide the noun: "What composing reads of hits" instead of "Per-hit records read when composing".
OPENING = re.compile(r"(?:What|Of|As|Whether|How|Where)\b")
PHRASES = {
    "that of, those of": re.compile(r"\b(?:that|those) of\b"),
    "in place of": re.compile(r"\bin place of\b"),
    "beside": re.compile(r"\bbeside\b"),
    "nobody, somebody, stranger, looked at": re.compile(r"\b(?:nobody|somebody|strangers?|looked at)\b", re.IGNORECASE),
}
HEADING = re.compile(r"^#+ (.*)$", re.MULTILINE)
FENCED = re.compile(r"^```\w*\n.*?^```$", re.MULTILINE | re.DOTALL)
OPENINGS = "openings without a noun"
FSTRING_MIDDLE = getattr(tokenize, "FSTRING_MIDDLE", -1)  # Python 3.12 splits f-strings into tokens


def docstrings(tree: ast.AST) -> Iterator[str]:
    """Yield the docstrings of a module, its classes and functions, and the texts below fields of classes."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            for statement in node.body:
                match statement:
                    case ast.Expr(value=ast.Constant(value=str(text))):
                        yield text


def texts(source: str) -> str:
    """Return all comments and strings of a Python file, on lines of their own."""
    found = []
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type in (tokenize.COMMENT, tokenize.STRING) or token.type == FSTRING_MIDDLE:
            found.append(token.string)
    return "\n".join(found)


def counts_of_code(files: list[Path]) -> dict[str, int]:
    """Count openings of docstrings, and phrases in comments and strings, of Python files."""
    counts = dict.fromkeys([OPENINGS, *PHRASES], 0)
    for file in files:
        source = file.read_text(encoding="utf-8")
        counts[OPENINGS] += sum(bool(OPENING.match(text.lstrip())) for text in docstrings(ast.parse(source)))
        said = re.sub(r"\s+(?:#\s*)?", " ", texts(source))
        for name, phrase in PHRASES.items():
            counts[name] += len(phrase.findall(said))
    return counts


def counts_of_pages(files: list[Path]) -> dict[str, int]:
    """Count openings of headings, and phrases, of Markdown pages."""
    counts = dict.fromkeys([OPENINGS, *PHRASES], 0)
    for file in files:
        said = FENCED.sub("", file.read_text(encoding="utf-8"))
        counts[OPENINGS] += sum(bool(OPENING.match(heading)) for heading in HEADING.findall(said))
        for name, phrase in PHRASES.items():
            counts[name] += len(phrase.findall(re.sub(r"\s+", " ", said)))
    return counts
