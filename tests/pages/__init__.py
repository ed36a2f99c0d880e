"""Scripts that write generated pages of `docs/`."""
