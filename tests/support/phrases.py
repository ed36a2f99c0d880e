"""What libraries write about wrong values, and messages of the program must not repeat."""

from functools import cache

from pydantic_core._pydantic_core import list_all_errors  # the public module names no errors

ERRORS = {error["type"]: error for error in list_all_errors()}  # all types of errors of pydantic
OF_PARSERS = ("is not a valid", "is not in the range", "is not one of", "unable to parse", "Invalid value for")


@cache
def library_phrases() -> tuple[str, ...]:
    """The beginnings of all messages of pydantic, such as "Input should be" and "Value error,"."""
    heads = {error["message_template_python"].partition("{")[0].strip() for error in ERRORS.values()}
    return (*sorted(head for head in heads if len(head) > 8), *OF_PARSERS)


def library_phrase(text: str) -> str | None:
    """Find the first phrase of a library in a text."""
    return next((phrase for phrase in library_phrases() if phrase.lower() in text.lower()), None)
