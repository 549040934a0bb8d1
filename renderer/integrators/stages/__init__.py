"""The stages that process a batch of paths, from camera rays to scattering."""
