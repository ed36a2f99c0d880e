"""How far images are from right: error, bias, and the standard error that they report."""
