"""Sums over light positions, without a ray: soft light, environments, weights of a file."""
