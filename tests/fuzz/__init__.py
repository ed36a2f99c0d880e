"""Broken input by the thousand: every outcome is a picture or one clear message. `PYTHONPATH=tests python -m fuzz`."""
