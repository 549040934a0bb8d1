"""What scenes are made of: BSDFs, lights, sensors, shapes, textures; a file each."""
