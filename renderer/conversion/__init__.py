"""Files of other programs become Mitsuba 3 scenes; nothing is rendered here."""
