"""Displays a picture during its render: a web page, tev, a notebook."""
