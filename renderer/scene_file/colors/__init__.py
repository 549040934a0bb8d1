"""Colours and spectra."""
