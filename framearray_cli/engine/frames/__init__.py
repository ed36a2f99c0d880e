"""One frame's hits: how many and where, their terms, and the frames that see them."""
