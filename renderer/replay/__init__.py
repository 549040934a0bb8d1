"""Replay of Mitsuba: its random numbers in its order, so that both trace the same paths."""
