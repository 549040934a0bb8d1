"""Whether a difference of a replay is rounding, and of what kind."""
