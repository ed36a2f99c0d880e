"""Shared by all measurements: cases of jobs, the machine, results, tables and plots."""
