"""Finding the nearest hit fast: brute force, and structures that agree with it."""
