"""OBJ and MTL files -> parts and materials."""
