"""SIMD values as Numba types, with ordinary operators; see `types`."""
