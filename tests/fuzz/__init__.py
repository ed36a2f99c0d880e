"""Broken input by the thousand: every outcome is a picture or one clear message; `make fuzz-readers` finds more."""
