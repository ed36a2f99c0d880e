"""The cost of an image, beside the floor that Embree sets, and as a job grows."""
