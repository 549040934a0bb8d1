"""What all structures do with a ray, or with sixteen."""
