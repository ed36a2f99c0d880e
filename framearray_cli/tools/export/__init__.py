"""Export a frame array to other tools: nerfstudio, COLMAP, Cinema."""

from .write import EXPORT_KINDS, MOST_POINTS, ExportKind, ExportResult, export_array

__all__ = ["EXPORT_KINDS", "MOST_POINTS", "ExportKind", "ExportResult", "export_array"]
