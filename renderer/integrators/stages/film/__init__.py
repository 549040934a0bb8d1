"""From the film to a ray, and back: camera rays, their random numbers, and the sums."""
