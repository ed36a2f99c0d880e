"""The same images by other programs."""
