"""Choosing one of several lights at a point, by what each can give there."""
