"""Replay of paths in participating media, in the order of Mitsuba's `volpath`."""
