"""What an image costs, beside the floor that Embree sets, and as a job grows."""
