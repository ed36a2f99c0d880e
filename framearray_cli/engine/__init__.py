"""Arrays in, images out; knows no job and no file."""
