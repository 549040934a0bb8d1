"""Plans: what is rendered for a scene, how, and why."""
