"""What is asked of both renderers, and what is written down of their answers."""
