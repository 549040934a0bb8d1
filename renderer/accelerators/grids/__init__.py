"""Uniform grids, and grids in grids."""
