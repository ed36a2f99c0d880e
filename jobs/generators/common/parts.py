"""Parts: meshes with the names of their materials."""

from .shapes import Mesh, mirror_x, move, turn

Part = list[tuple[str, Mesh]]


def moved(part: Part, x: float = 0.0, y: float = 0.0, z: float = 0.0, turn_y: float = 0.0) -> Part:
    """The part turned about y (degrees), then moved."""
    return [(material, move(turn(mesh, "y", turn_y), x, y, z)) for material, mesh in part]


def reflected(part: Part) -> Part:
    """The part mirrored at x = 0."""
    return [(material, mirror_x(mesh)) for material, mesh in part]


def mirrored(part: Part) -> Part:
    """A part of the right half together with its mirror image."""
    return part + reflected(part)
