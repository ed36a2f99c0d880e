"""Commands, screen, signals, options."""
