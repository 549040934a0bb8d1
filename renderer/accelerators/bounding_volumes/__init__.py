"""Bounding volumes."""
