"""A frame array on disk: names, manifest, record, lock, folder, images, pictures."""
