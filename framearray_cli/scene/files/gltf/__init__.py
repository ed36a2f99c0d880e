"""glTF and GLB files -> parts, materials, cameras, lights and their motion."""
