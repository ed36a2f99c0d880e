"""Tools for an array: movie, sheet, export, view."""

from collections.abc import Callable
from typing import TypeAlias

Progress: TypeAlias = Callable[[int, int], None]  # pictures done, pictures in all
