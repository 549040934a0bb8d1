"""Surfaces by their (u, v): points, and how far apart texels lie."""
