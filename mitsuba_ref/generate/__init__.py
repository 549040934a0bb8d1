"""Scenes at random over the whole grammar: a replay judges each, a reducer cuts it down."""
