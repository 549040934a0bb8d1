"""Scenes with less in them: named steps from one SceneDescription to another."""
