"""Our renderer's side of a comparison, and its kernels compiled ahead."""
