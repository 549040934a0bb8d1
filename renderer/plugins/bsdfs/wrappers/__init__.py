"""BSDFs around others: two sides, holes, blends, bumps."""
