"""Mitsuba's random numbers, in its order."""
