"""The page of a study of accelerators."""
