"""The stages of a batch of paths, from camera rays to scattering."""
