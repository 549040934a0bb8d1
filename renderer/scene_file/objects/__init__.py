"""From elements to the description: a reader for each kind of object."""
