"""The tree with eight children a node: built, checked, and traversed by one ray."""
