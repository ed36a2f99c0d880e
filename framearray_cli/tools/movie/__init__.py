"""Movies and image sequences out of a frame array: paths through it, changed light, and the files."""
