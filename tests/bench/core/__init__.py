"""What all measurements share: cases of jobs, the machine, results, tables and plots."""
