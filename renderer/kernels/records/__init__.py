"""What stages hand on, and what they may look at: flat arrays in named records."""
