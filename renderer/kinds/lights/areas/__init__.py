"""Shapes that shine."""
