"""Mesh files -> `Scene`; paths of eyes and lights."""
