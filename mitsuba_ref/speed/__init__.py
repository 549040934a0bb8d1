"""Mitsuba and our renderer by the clock: speed against accuracy, rays per path."""
