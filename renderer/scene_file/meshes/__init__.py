"""Meshes: OBJ, PLY, cubes, and what is checked about them."""
