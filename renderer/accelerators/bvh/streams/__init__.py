"""Traversal of many rays at a time: packets, beams and streams."""
