"""What scenes are made of, a file for each kind: BSDFs, lights, shapes, textures."""
