"""Random numbers, and the warps from the unit square to directions and surfaces."""
