"""Models that tests make for `framearray init`, and labels: what a good first picture of each shows."""
