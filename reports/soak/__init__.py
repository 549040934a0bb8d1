"""Long trials that look for the rare: rays that leak, files that crash, memory that grows."""
