"""Light from infinitely far away, from every direction."""
