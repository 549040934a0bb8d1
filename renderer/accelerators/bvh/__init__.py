"""Bounding volume hierarchies."""
