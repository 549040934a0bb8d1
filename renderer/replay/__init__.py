"""Mitsuba's random numbers, drawn in its order: two renderers, the same paths."""
