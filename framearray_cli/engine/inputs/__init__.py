"""Scene, eyes, lights and random numbers, as kernels take them."""
