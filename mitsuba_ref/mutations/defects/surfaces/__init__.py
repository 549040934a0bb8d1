"""Defects of BSDFs, textures and spectra."""
