"""Fuzzing that follows coverage: readers of files in one process, driven by Atheris; `python -m fuzz.covered`."""
