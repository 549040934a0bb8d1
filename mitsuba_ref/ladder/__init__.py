"""The ladder of tests, climbed with many pictures of both renderers."""
