"""Our renderer's side of a comparison."""
