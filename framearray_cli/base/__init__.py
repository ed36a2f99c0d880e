"""Types, errors, files, colour, hashing, memory, units, optional libraries, forms of files."""
