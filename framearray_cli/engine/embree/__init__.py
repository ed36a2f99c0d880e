"""The door to Embree: its library, scenes to trace rays through, and rays in packets."""
