"""What Mitsuba lacks or does wrong, made good on its side."""
