"""A frame array for other tools: nerfstudio, COLMAP, Cinema."""

from .write import KINDS, POINTS, ExportResult, Kind, export

__all__ = ["KINDS", "POINTS", "ExportResult", "Kind", "export"]
