"""The ambient light I_A, by each method."""
