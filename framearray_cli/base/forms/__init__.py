"""Forms of files: validated tables, their schema, and every problem of a file in one message."""
