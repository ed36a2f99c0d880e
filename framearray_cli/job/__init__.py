"""Job file -> `Job`."""
