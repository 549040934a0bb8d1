"""The page of what the scenes prove, and how far to trust it."""
