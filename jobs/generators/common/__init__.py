"""What several scenes share: shapes, textures, furniture, plants, and the GLB writer."""
