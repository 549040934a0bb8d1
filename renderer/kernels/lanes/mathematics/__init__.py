"""Functions of sixteen float32 at once."""
