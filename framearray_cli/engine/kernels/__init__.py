"""Compiling hot loops, and keeping their machine code."""
