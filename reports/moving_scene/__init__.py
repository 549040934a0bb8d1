"""For `limits`, until it is a study; see `studies.moving_scene`."""
