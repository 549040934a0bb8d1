"""Single paths in both renderers, step by step, side by side."""
