"""Integrators: each is a loop over the stages in `integrators.stages`."""
