"""A theatre staircase."""

from .scene import build

__all__ = ["build"]
