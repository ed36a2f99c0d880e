"""How hot loops are compiled, and where compiled ones are kept."""
