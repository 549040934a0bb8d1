"""For `beside_peers`, until it is a study; see `trials.ray_times`."""
