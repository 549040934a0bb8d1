"""The reference: a scene file in Mitsuba, in a process of its own, and the cache."""
