"""Radiosity cells: the light on surfaces under every light position, solved once a job, for gather rays to read."""
