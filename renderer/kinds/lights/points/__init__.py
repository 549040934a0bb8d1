"""Lights that no ray meets by chance: points, and one direction."""
