"""Pictures: the result of a render, and image files."""
