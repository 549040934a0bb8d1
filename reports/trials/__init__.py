"""What several studies measure with: meshes, rays, contenders, and how they are traced."""
