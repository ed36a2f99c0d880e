"""The ambient estimate: its level and its pictures against path tracing."""
