"""One file a command: it parses, calls one function, prints. Heavy imports happen when a command runs."""
