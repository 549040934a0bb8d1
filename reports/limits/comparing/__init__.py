"""Comparing pictures: when two right ones differ, and when a wrong one looks right."""
