"""Seconds of both renderers, measured in turn, and their page."""
