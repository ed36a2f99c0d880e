"""Key frames -> positions of every eye and light."""
