"""Shared by all tests; its place lets them import the helpers beside it."""
