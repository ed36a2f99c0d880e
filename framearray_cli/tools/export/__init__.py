"""Export a frame array to other tools: nerfstudio, COLMAP, Cinema, RTI, and sets for learning."""

from .formats import EXPORT_KINDS, ExportKind
from .splits import SplitOptions
from .write import MOST_POINTS, ExportResult, export_array

__all__ = ["EXPORT_KINDS", "MOST_POINTS", "ExportKind", "ExportResult", "SplitOptions", "export_array"]
