"""Shapes: where rays meet them, what their surface is, how they shine."""
