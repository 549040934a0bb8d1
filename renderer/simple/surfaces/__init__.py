"""What a ray of the simple tracer meets: shapes, textures, BSDFs."""
