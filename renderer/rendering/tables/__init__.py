"""Builds the kernels' record of a scene and a plan: tables of records and methods."""
