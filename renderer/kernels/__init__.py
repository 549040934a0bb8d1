"""Compilation of kernels, SIMD lane types, and the records that kernels work on."""
