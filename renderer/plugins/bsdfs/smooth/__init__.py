"""Smooth surfaces: diffuse ones, and mirrors, glass and plastic by Fresnel's equations."""
