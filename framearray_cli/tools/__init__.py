"""What people do with an array: movie, sheet, export, view."""
