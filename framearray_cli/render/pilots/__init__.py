"""Pilots: a look at a few eyes and light positions before a render, and warnings of pictures that would be useless."""
