"""The reference: a scene file in Mitsuba, in a separate process, and the cache."""
