"""Reads and checks meshes: OBJ, PLY, serialized files, cubes."""
