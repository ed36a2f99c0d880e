"""Rays -> hits: native hits of an eye, and the pixels of other eyes that see them."""
