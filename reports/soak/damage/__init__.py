"""Damaged files: sound ones, what is done to them, and a process that renders the rest."""
