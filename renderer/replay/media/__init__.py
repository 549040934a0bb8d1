"""Paths in participating media, in the order of Mitsuba's `volpath`."""
