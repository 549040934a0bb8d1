"""Sensors: generation of camera rays."""
