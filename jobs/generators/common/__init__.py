"""Shared by all scenes: shapes, textures, furniture, plants, and the GLB writer."""
