"""framearray: every image of an animated camera under every position of an animated light."""

__version__ = "0.1.0"
