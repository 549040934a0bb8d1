"""Octree and BSP tree."""
