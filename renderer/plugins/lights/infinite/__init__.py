"""Light from infinitely far away: environments, and one direction."""
