"""Shapes: ray intersection, surface points and normals, and sampling of area lights."""
