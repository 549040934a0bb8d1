"""What fills the space between surfaces: volumes, phase functions, free flight."""
