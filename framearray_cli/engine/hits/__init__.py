"""Rays -> hits: native ones of an eye, and the pixels of other eyes that see them."""
