"""The surface at a hit: position, frame, derivatives, and its place in the world."""
