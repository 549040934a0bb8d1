"""Colours over (u, v): a file for each kind of texture."""
