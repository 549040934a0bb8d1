"""What will be done for a scene, and why."""
