"""The same random numbers in both renderers: pictures replayed, paths traced."""
