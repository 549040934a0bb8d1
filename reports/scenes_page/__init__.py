"""The page of all scenes: both renderers' pictures side by side."""
