"""Glossy surfaces against a path tracer with the surfaces of glTF 2.0, appendix B."""
