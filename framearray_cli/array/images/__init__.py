"""Image files: written whole, read back, checked."""
