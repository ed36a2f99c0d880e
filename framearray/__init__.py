"""The public Python package: frame arrays as numpy, xarray and zarr, and renders with events.

    >>> import framearray
    >>> array = framearray.open("array")
    >>> array
    <FrameArray 'room': 4 camera positions x 3 of light x 2 of lamps, 24 x 18 pixels>
    >>> array.picture(1, 2).shape
    (18, 24, 3)

docs/guide/python.md describes it. Everything else is in `framearray_cli`, whose modules may change from version to
version. Importing this package loads nothing more: each name is loaded when it is first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from framearray_cli import __version__

if TYPE_CHECKING:  # for type checkers and editors: what `__getattr__` loads
    from framearray_cli.base.errors import (
        BusyError,
        FrameArrayError,
        JobError,
        MissingExtraError,
        OutputError,
        SceneError,
    )
    from framearray_cli.render.events import (
        AmbientEstimated,
        Compiling,
        Event,
        Finished,
        FramesBegun,
        FrameWritten,
        HitsAllotted,
        KernelsLoaded,
        Noted,
        Progress,
        Scanned,
        Started,
        Warned,
        Working,
    )

    from .array import FrameArray
    from .array import open_array as open
    from .cameras import Camera, Cameras
    from .jobs import Checked, check
    from .lights import Light, Lights
    from .run import RenderCancelled, Rendering, render, rendering
    from .sheets import Sheet

__all__ = [
    "AmbientEstimated",
    "BusyError",
    "Camera",
    "Cameras",
    "Checked",
    "Compiling",
    "Event",
    "Finished",
    "FrameArray",
    "FrameArrayError",
    "FrameWritten",
    "FramesBegun",
    "HitsAllotted",
    "JobError",
    "KernelsLoaded",
    "Light",
    "Lights",
    "MissingExtraError",
    "Noted",
    "OutputError",
    "Progress",
    "RenderCancelled",
    "Rendering",
    "Scanned",
    "SceneError",
    "Sheet",
    "Started",
    "Warned",
    "Working",
    "__version__",
    "check",
    "open",
    "render",
    "rendering",
]

# Where each public name is; "module:name" if it has another name there.
_PLACES = {
    name: module
    for module, names in {
        "framearray_cli.base.errors": ("BusyError FrameArrayError JobError MissingExtraError OutputError SceneError"),
        "framearray_cli.render.events": (
            "AmbientEstimated Compiling Event Finished FramesBegun FrameWritten HitsAllotted KernelsLoaded "
            "Noted Progress Scanned Started Warned Working"
        ),
        ".array": "FrameArray",
        ".array:open_array": "open",
        ".cameras": "Camera Cameras",
        ".jobs": "Checked check",
        ".lights": "Light Lights",
        ".run": "RenderCancelled Rendering render rendering",
        ".sheets": "Sheet",
    }.items()
    for name in names.split()
}


def __getattr__(name: str) -> Any:
    """Load a public name when it is first used."""
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, _, original = _PLACES[name].partition(":")
    found = getattr(import_module(module, __name__), original or name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return list(__all__)
