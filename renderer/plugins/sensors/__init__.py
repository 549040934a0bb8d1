"""Sensors: where the rays of a picture begin."""
