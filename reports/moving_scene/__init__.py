"""Refit or rebuild: what a moving scene costs either way."""
