"""The ambient intensity I_A, by each method."""
