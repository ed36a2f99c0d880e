"""Values as a TOML file has them, on one line each."""

import json
from collections.abc import Sequence
from typing import Any


def inline(value: Any) -> str:
    """Write a plain value: a table and a list on one line too."""
    import tomli_w

    if isinstance(value, dict):
        return f"{{ {', '.join(f'{key} = {inline(item)}' for key, item in value.items())} }}"
    if isinstance(value, list):
        return f"[{', '.join(inline(item) for item in value)}]"
    return tomli_w.dumps({"x": value}).removeprefix("x = ").rstrip("\n")


def numbers(values: Sequence[float]) -> str:
    """Write numbers as floats; `repr` gives the shortest text that reads back as the same float."""
    return f"[{', '.join(repr(float(value)) for value in values)}]"


def quoted(text: str) -> str:
    """Write any text; control characters are escaped, and halves of characters, which TOML cannot hold, replaced."""
    whole = text.encode("utf-8", "replace").decode("utf-8")
    return json.dumps(whole, ensure_ascii=False).replace("\x7f", "\\u007f")


def brief(value: bool | str | float) -> str:
    """Write a setting, a number with up to six digits."""
    return json.dumps(value) if isinstance(value, bool | str) else f"{value:g}"
