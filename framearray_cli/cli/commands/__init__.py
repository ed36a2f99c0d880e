"""One file per command: it parses, calls one function, prints. Heavy imports happen when a command runs."""
