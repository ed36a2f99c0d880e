"""An aircraft cabin."""

from .scene import build

__all__ = ["build"]
