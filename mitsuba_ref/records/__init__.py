"""Requests to both renderers, and records of their results."""
