"""Rough surfaces: microfacets, and the principled models that are made of them."""
