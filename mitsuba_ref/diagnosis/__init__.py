"""A verdict on any picture of a scene, and the name of the mistake in it."""
