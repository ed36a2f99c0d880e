"""A farmhouse kitchen."""

from .scene import build

__all__ = ["build"]
