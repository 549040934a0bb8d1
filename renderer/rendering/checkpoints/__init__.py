"""The state of a render in a file, from which it goes on (docs/checkpoints.md)."""
