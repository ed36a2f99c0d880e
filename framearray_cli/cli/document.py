"""The JSON document of a command: what it holds is collected while the command runs, and printed at its end."""

import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

from framearray_cli import __version__

REMARKS = ("note: ", "warning: ")  # how lines begin that are no results


@dataclass(slots=True)
class Outcome:
    """Results of the running command so far.

    Attributes:
        wanted: whether the command line says `--json`.
        remarks: lines that begin with "note: " or "warning: ".
        result: an instance of one of `RESULTS`.
    """

    wanted: bool = False
    remarks: list[str] = field(default_factory=list)
    result: object = None

    def remember(self, lines: Iterable[str]) -> None:
        """Keep notes and warnings among the lines that are printed."""
        self.remarks += [line for line in lines if line.startswith(REMARKS)]

    def begin(self, arguments: Sequence[str]) -> None:
        """Forget the last command; see whether this one wants a document."""
        before = list(arguments)[: list(arguments).index("--")] if "--" in arguments else arguments
        self.wanted, self.remarks, self.result = "--json" in before, [], None


outcome = Outcome()  # one command runs at a time


def document_text(command: str, exit_code: int, problems: Sequence[str]) -> str:
    """Write the document of the command that ends."""
    from .results import Document  # takes long to import

    document = Document(
        framearray=__version__,
        command=command,
        exit_code=exit_code,
        problems=tuple(problems),
        warnings=tuple(line.removeprefix("warning: ") for line in outcome.remarks if line.startswith("warning: ")),
        notes=tuple(line.removeprefix("note: ") for line in outcome.remarks if line.startswith("note: ")),
        result=outcome.result,
    )
    return json.dumps(_plain(asdict(document)), indent=2, ensure_ascii=False, allow_nan=False)


def _plain(value: Any) -> Any:
    """Turn a value into what JSON has: no infinite numbers, no numbers of numpy."""
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, Path | Fraction):
        return str(value) if isinstance(value, Path) else float(value)
    if hasattr(value, "item"):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _reference(kind: type) -> dict[str, str]:
    return {"$ref": f"#/$defs/{kind.__name__}"}


def results_schema() -> dict[str, Any]:
    """Make the JSON Schema (2020-12) of the documents of all commands."""
    from pydantic import TypeAdapter  # takes long to import, as the next

    from framearray_cli.base.forms.schema import DIALECT, with_docstrings

    from .results import RESULTS, Document

    types = {"Document": Document} | {kind.__name__: kind for kinds in RESULTS.values() for kind in kinds}
    _, parts = TypeAdapter.json_schemas(
        [(name, "serialization", TypeAdapter(kind)) for name, kind in types.items()],
        ref_template="#/$defs/{model}",
        schema_generator=with_docstrings(),
    )
    definitions = parts["$defs"]
    whole = definitions.pop("Document")
    return {
        "$schema": DIALECT,
        **whole,
        "title": "framearray result",
        "allOf": [
            {
                "if": {"properties": {"command": {"const": name}}},
                "then": {"properties": {"result": {"anyOf": [*map(_reference, kinds), {"type": "null"}]}}},
            }
            for name, kinds in RESULTS.items()
        ],
        "$defs": definitions,
    }
