"""From the rows of a study to its page."""
