"""One accelerator on one mesh: built, checked hit for hit, counted, timed."""
