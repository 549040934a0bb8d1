"""Flat primitives: triangles, and meshes of them, rectangles, disks."""
