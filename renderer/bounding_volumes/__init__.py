"""Volumes that enclose objects and are faster to test: sphere, boxes, slabs."""
