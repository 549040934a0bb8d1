"""The renderer written to be read: one ray at a time, in plain Python and NumPy."""
