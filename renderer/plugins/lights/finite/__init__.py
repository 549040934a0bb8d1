"""Light from places in the scene: shapes that shine, and points."""
