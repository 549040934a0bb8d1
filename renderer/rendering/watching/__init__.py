"""Pictures of a render that is under way: a page, tev, a notebook."""
