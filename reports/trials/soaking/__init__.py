"""Long trials for the rare: rays that leak, files that crash, memory that grows."""
