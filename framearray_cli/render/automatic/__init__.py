"""Settings that a job leaves to the program."""
