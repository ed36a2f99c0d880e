"""Generators of the project's own scenes: `python -m jobs.generators [NAME [FILE]]`, from the root of the project."""
