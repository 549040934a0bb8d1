"""Acceleration structures, and brute force, with which each of them must agree."""
