"""The operations of Mitsuba's wheels and of Embree, bit for bit."""
