"""Rays from inside of closed meshes, by every structure: none may be lost."""
