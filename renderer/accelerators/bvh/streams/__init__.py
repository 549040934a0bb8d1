"""Many rays at a time: packets, beams, and streams through a tree."""
