"""What a point of a surface knows besides its place: normals, (u, v) and derivatives."""
