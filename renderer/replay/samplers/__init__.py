"""Mitsuba's samplers, number by number."""
