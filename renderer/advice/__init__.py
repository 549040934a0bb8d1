"""Advice that renders nothing: cautions about a scene, and what it may do without."""
