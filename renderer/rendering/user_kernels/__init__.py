"""Finds errors in a user's kernels before large kernels are compiled; one line for each."""
