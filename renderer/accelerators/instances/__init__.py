"""Groups of primitives, and instances of groups."""
