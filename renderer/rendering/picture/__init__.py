"""Pictures: what a render gives back, and files of it."""
