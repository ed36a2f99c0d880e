"""An array in parts: chunks of the camera path, for farms and for several processes or machines at once."""
