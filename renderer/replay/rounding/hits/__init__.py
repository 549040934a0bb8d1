"""Where rays meet shapes, as Embree and Mitsuba round it."""
