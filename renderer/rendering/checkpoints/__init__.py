"""Checkpoints: the state of a render in a file, to resume it (docs/checkpoints.md)."""
