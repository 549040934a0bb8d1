"""Tests that give p-values."""
