"""Hits of a window of frames -> images."""
