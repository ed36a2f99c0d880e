"""Helpers of several tests: tiny scenes and jobs, hand-made arrays, the slow twin, the program as a process."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]  # of the project
