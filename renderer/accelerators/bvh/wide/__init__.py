"""The tree of eight children per node: build, checks, and traversal by single rays."""
