"""Directions, hits and rays as Mitsuba and Embree round them."""
