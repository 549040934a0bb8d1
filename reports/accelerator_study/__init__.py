"""Every accelerator on every study scene, as one record."""
