"""Surfaces where a function is zero: formulas, and grids of signed distances."""
