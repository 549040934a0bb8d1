"""What judges a scene: numbers of one picture, AOVs, the ladder of tests; one verdict."""
