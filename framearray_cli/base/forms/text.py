"""Values as TOML text, on one line each."""

import json
from collections.abc import Sequence
from typing import Any


def inline(value: Any) -> str:
    """Write a plain value; tables and lists on one line as well."""
    import tomli_w

    if isinstance(value, dict):
        return f"{{ {', '.join(f'{key} = {inline(item)}' for key, item in value.items())} }}"
    if isinstance(value, list):
        return f"[{', '.join(inline(item) for item in value)}]"
    return tomli_w.dumps({"x": value}).removeprefix("x = ").rstrip("\n")


def inline_floats(values: Sequence[float]) -> str:
    """Write a list of floats; `repr` gives the shortest text that reads back as the same float."""
    return f"[{', '.join(repr(float(value)) for value in values)}]"


def quoted(text: str) -> str:
    """Write any text: escape control characters, and replace lone surrogates, which TOML cannot hold."""
    whole = text.encode("utf-8", "replace").decode("utf-8")
    return json.dumps(whole, ensure_ascii=False).replace("\x7f", "\\u007f")


def brief(value: bool | str | float) -> str:
    """Write a setting; a number with at most six digits."""
    return json.dumps(value) if isinstance(value, bool | str) else f"{value:g}"
