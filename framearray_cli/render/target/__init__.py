"""Native hits by place, for an error that a job asks for."""
