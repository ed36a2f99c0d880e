"""Values and keys of a file, as messages show them."""

import json
import re

FARTHEST = 1e12  # scene units; squares and cubes of it still fit in float32 (3e38)

LONGEST_SHOWN = 40  # characters of a found value in a message


def shown(value: object) -> str:
    """Describe a found value as it would stand in a TOML file, shortened."""
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, list | tuple):
        if 0 < len(value) <= 4 and not any(isinstance(item, dict | list | tuple) for item in value):
            whole = f"[{', '.join(shown(item) for item in value)}]"
            if len(whole) <= LONGEST_SHOWN:
                return whole
        kind = "table" if value and isinstance(value[0], dict) else "value"
        return f"a list of {len(value)} {kind}{'s' if len(value) != 1 else ''}"
    if isinstance(value, bool | str):
        text = json.dumps(value[:1000] if isinstance(value, str) else value, ensure_ascii=False)
    elif isinstance(value, int) and value.bit_length() > 64:
        return "a number beyond 64 bits"
    else:
        text = str(value)
    return text if len(text) <= LONGEST_SHOWN else text[: LONGEST_SHOWN - 4] + "..." + text[-1]


# The reader of TOML takes time and memory by the square of this number.
MOST_PARTS = 6  # keys with dots between them; no file has more than 4

_KEY = r"""(?:[A-Za-z0-9_-]++|"[^"\n]*+"|'[^'\n]*+')"""

_LONG_KEY = re.compile(rf"(?:^|[\[{{,])[ \t]*+{_KEY}(?:[ \t]*+\.[ \t]*+{_KEY}){{{MOST_PARTS}}}", re.MULTILINE)


def long_key(text: str) -> str | None:
    """What is wrong with a TOML text whose keys have too many parts, or None."""
    found = _LONG_KEY.search(text)
    if not found:
        return None
    line = text.count("\n", 0, found.start()) + 1
    return f"line {line}: expected at most {MOST_PARTS} keys with dots between them, got more"


def between(low: float, high: float) -> str:
    """Say a range of numbers, "from 0 to 1"; bounds that only protect the arithmetic are left out."""
    if high >= FARTHEST:
        return "" if low <= -FARTHEST else f"of at least {number(low)}"
    return f"from {number(low)} to {number(high)}"


def number(value: float) -> str:
    """Write a bound: whole numbers in full where they are short."""
    return str(int(value)) if value == int(value) and abs(value) < FARTHEST else f"{value:g}"
