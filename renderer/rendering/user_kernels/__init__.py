"""Mistakes in a user's kernels: found before large kernels are compiled, said in a line."""
