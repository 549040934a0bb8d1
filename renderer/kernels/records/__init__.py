"""Records of flat arrays: the state that stages pass on, and the scene that they read."""
