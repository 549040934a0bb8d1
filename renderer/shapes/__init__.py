"""Primitives and their intersection with rays."""
