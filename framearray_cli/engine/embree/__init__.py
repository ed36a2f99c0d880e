"""The door to Embree: build a scene, find first hits, test visibility.

Kernels trace packets through a `Tracer`, which holds only addresses. Therefore compiled kernels can be cached, and two
engines serve the same kernels:

- `packets`: Embree's C functions `rtcIntersect16` and `rtcOccluded16`, or those of 8 or 4 rays per call where the
  processor has no wider ones (`embree_c.py`). The default.
- `embreex`: the public API of embreex, which calls Embree once per ray. The fallback where the symbols cannot be
  reached, and the twin that tests compare packets with.
"""

from dataclasses import replace
from types import TracebackType
from typing import Literal, Self

from framearray_cli.base.errors import SceneError
from framearray_cli.scene.scene import Scene

from ..embree_c import embree_library
from .fallback import EmbreexScene
from .native import NativeScene
from .packets import Tracer

__all__ = ["EmbreeScene", "Engine", "Tracer"]

Engine = Literal["auto", "packets", "embreex"]


class EmbreeScene:
    """A scene to trace rays through; owns Embree's structures and frees them on `close`.

    Attributes:
        engine: how rays are traced.
        tracer: of all triangles but glass.
        panes: of the triangles of thin glass; None without.
    """

    def __init__(self, scene: Scene, engine: Engine = "auto") -> None:
        """Build the acceleration structure.

        Args:
            scene: the triangles; opaque ones become geometry 0, those with an alpha mask geometry 1.
            engine: "auto" uses packets where Embree's symbols can be reached, else embreex.

        Raises:
            SceneError: Embree rejects the scene, or `engine="packets"` is not available.
        """
        library = None if engine == "embreex" else embree_library()
        if engine == "packets" and library is None:
            raise SceneError("embree: the C functions of the embreex wheel cannot be reached; use the engine 'embreex'")
        self.engine: Engine = "packets" if library else "embreex"
        self._built = NativeScene(scene, library) if library else EmbreexScene(scene)
        self.tracer: Tracer = self._built.tracer
        panes = replace(scene, corners=scene.pane_corners, n_opaque=len(scene.pane_corners))
        self._glass = (NativeScene(panes, library) if library else EmbreexScene(panes)) if scene.has_glass else None
        self.panes: Tracer | None = self._glass.tracer if self._glass else None

    def close(self) -> None:
        """Free Embree's memory; do not trace afterwards."""
        self._built.close()
        if self._glass:
            self._glass.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
