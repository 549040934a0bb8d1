"""Which bounding volume for which object."""
