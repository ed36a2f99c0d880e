"""Values and bounds, as messages show them."""

import json

from ..units import FARTHEST, counted

LONGEST_SHOWN = 40  # characters of a found value in a message


def shown(value: object) -> str:
    """Write a value as a TOML file has it, shortened."""
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, list | tuple):
        if 0 < len(value) <= 4 and not any(isinstance(item, dict | list | tuple) for item in value):
            whole = f"[{', '.join(shown(item) for item in value)}]"
            if len(whole) <= LONGEST_SHOWN:
                return whole
        return f"a list of {counted(len(value), 'table' if value and isinstance(value[0], dict) else 'value')}"
    if isinstance(value, bool | str):
        text = json.dumps(value[:1000] if isinstance(value, str) else value, ensure_ascii=False)
    elif isinstance(value, int) and value.bit_length() > 64:
        return "a number beyond 64 bits"
    else:
        text = str(value)
    return text if len(text) <= LONGEST_SHOWN else text[: LONGEST_SHOWN - 4] + "..." + text[-1]


def range_text(low: float, high: float) -> str:
    """Write a range of numbers, "from 0 to 1", without bounds that only protect the arithmetic."""
    if high >= FARTHEST:
        return "" if low <= -FARTHEST else f"of at least {bound_text(low)}"
    return f"from {bound_text(low)} to {bound_text(high)}"


def bound_text(value: float) -> str:
    """Write a bound: a whole number in full, unless it is long."""
    return str(int(value)) if value == int(value) and abs(value) < FARTHEST else f"{value:g}"


def printable(text: str) -> str:
    """Escape invisible characters: names may hold escape sequences, or reverse the line."""
    if text.replace("\n", "").isprintable():
        return text
    return "".join(c if c.isprintable() or c in "\n\xa0" else c.encode("unicode_escape").decode() for c in text)
