"""The kd-tree and the three ways to split it."""
